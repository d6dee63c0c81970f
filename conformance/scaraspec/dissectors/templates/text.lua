-- Text: bytes as printable UTF-8 -------------------------------------------------------------

-- A piece is a part of the data of a frame: its bytes `s`, and their offset `at` in a Tvb.
local function sub(piece, first, last)
  return { tvb = piece.tvb, at = piece.at + first - 1, s = piece.s:sub(first, last) }
end

local function split(piece, separator)
  local pieces, from = {}, 1
  while true do
    local stop = piece.s:find(separator, from, true)
    pieces[#pieces + 1] = sub(piece, from, stop and stop - 1 or #piece.s)
    if not stop then
      return pieces
    end
    from = stop + 1
  end
end

-- Returns the code points of UTF-8, or nil if the bytes are not UTF-8.
local function utf8_points(s)
  local points, at = {}, 1
  while at <= #s do
    local byte = s:byte(at)
    local more, point, least
    if byte < 0x80 then
      more, point, least = 0, byte, 0
    elseif byte >= 0xC2 and byte < 0xE0 then
      more, point, least = 1, byte - 0xC0, 0x80
    elseif byte >= 0xE0 and byte < 0xF0 then
      more, point, least = 2, byte - 0xE0, 0x800
    elseif byte >= 0xF0 and byte < 0xF5 then
      more, point, least = 3, byte - 0xF0, 0x10000
    else
      return nil
    end
    for i = 1, more do
      local next_byte = s:byte(at + i)
      if not next_byte or next_byte < 0x80 or next_byte >= 0xC0 then
        return nil
      end
      point = point * 64 + next_byte - 0x80
    end
    if point < least or point > 0x10FFFF or (point >= 0xD800 and point < 0xE000) then
      return nil
    end
    points[#points + 1] = point
    at = at + more + 1
  end
  return points
end

local function utf8_char(point)
  if point < 0x80 then
    return string.char(point)
  end
  local tail, limit = "", 0x40
  while point >= limit do
    tail = string.char(0x80 + point % 64) .. tail
    point = math.floor(point / 64)
    limit = limit == 0x40 and 0x20 or limit / 2
  end
  return string.char(256 - 2 * limit + point) .. tail
end

local function within(byte, low, high)
  return byte ~= nil and byte >= low and byte <= high
end

-- Returns the code points of GB18030, or nil if the bytes are not GB18030.
local function gb18030_points(piece)
  local points, at, s = {}, 1, piece.s
  while at <= #s do
    local first, second = s:byte(at, at + 1)
    if first < 0x80 then
      points[#points + 1] = first
      at = at + 1
    else
      local size = within(second, 0x30, 0x39) and 4 or 2
      local third, fourth = s:byte(at + 2, at + 3)
      if size == 4 then
        if not (within(third, 0x81, 0xFE) and within(fourth, 0x30, 0x39)) then
          return nil
        end
      elseif not (within(first, 0x81, 0xFE) and within(second, 0x40, 0xFE) and second ~= 0x7F) then
        return nil
      end
      -- Some versions of Wireshark cut the result to the length of the range. A byte follows: the
      -- end byte of a frame, or the rest of a record.
      local range = piece.tvb(piece.at + at - 1, math.max(size, 3))
      local char = utf8_points(range:string(ENC_GB18030):match("^[^\128-\191][\128-\191]*") or "")
      if not char or #char ~= 1 or char[1] == 0xFFFD then
        return nil
      end
      points[#points + 1] = char[1]
      at = at + size
    end
  end
  return points
end

local function printable(point)
  if point < 0x7F then
    return point >= 0x20
  end
  for _, range in ipairs(SPEC.unprintable) do
    if point <= range[2] then
      return point < range[1]
    end
  end
  return true
end

-- Returns characters as text, cut if there are more than `limit`.
local function cut(chars, limit)
  if #chars <= limit then
    return table.concat(chars)
  end
  return table.concat(chars, "", 1, limit - 1) .. "…"
end

-- Returns bytes as text: UTF-8, else GB18030, else Latin-1 (A-T-2).
local function show(piece, limit)
  local points = utf8_points(piece.s) or gb18030_points(piece) or { piece.s:byte(1, -1) }
  local chars = {}
  for _, point in ipairs(points) do
    if printable(point) then
      chars[#chars + 1] = utf8_char(point)
    else
      for char in string.format("\\x%02x", point):gmatch(".") do
        chars[#chars + 1] = char
      end
    end
  end
  return cut(chars, limit or SPEC.show_limit)
end

local function cut_text(text)
  local chars = {}
  for _, point in ipairs(utf8_points(text)) do
    chars[#chars + 1] = utf8_char(point)
  end
  return cut(chars, SPEC.text_limit)
end
