-- Payloads: what the data of a frame means ----------------------------------------------------

-- Removes quotation marks (A-0-3) and trailing NULs (A-T-3).
local function normalize(piece, findings, is_digit)
  if piece.s:sub(-1) == "\0" and (#piece.s > 1 or not is_digit) then
    add_defect(findings, "trailing NUL")
    add_reading(findings, "trailing_nul", "yes")
    local size = #piece.s
    while size > 0 and piece.s:byte(size) == 0 do
      size = size - 1
    end
    piece = sub(piece, 1, size == 0 and is_digit and 1 or size)
  end
  for _, marks in ipairs({ { '"', '"' }, { "“", "”" } }) do
    local opening, closing = marks[1], marks[2]
    local s = piece.s
    if #s > #opening and s:sub(1, #opening) == opening and s:sub(-#closing) == closing then
      add_defect(findings, "quotes")
      piece = sub(piece, #opening + 1, #s - #closing)
    end
  end
  return piece
end

local function strip(piece)
  local first, last = 1, #piece.s
  while piece.s:sub(first, first) == " " do
    first = first + 1
  end
  while last >= first and piece.s:sub(last, last) == " " do
    last = last - 1
  end
  return sub(piece, first, last)
end

-- Splits the data at the bars, if possible into one piece for each field.
local function split_fields(piece, fields, findings)
  local count = #fields
  if count == 1 then
    return { piece }
  end
  local pieces = split(piece, "|")
  if #pieces == count + 1 and pieces[#pieces].s == "" then
    add_defect(findings, "trailing bar")
    table.remove(pieces)
  end
  if #pieces == 1 and #split(pieces[1], " ") == count then
    add_defect(findings, "space for bar")
    return split(pieces[1], " ")
  end
  if #pieces ~= count then
    return pieces
  end
  local has_blanks = false
  for i, field in ipairs(fields) do
    if not field.opaque then
      local bare = strip(pieces[i])
      has_blanks = has_blanks or bare.s ~= pieces[i].s
      pieces[i] = bare
    end
  end
  if has_blanks then
    add_defect(findings, "blanks")
  end
  return pieces
end

-- Each function decodes one kind of payload, like the functions in FIELD.
local PAYLOAD = {}

function PAYLOAD.no_data(_, piece, findings)
  if piece.s ~= "" then
    add_defect(findings, "size")
  end
  return nil
end

function PAYLOAD.record(payload, piece, findings)
  local pieces = split_fields(normalize(piece, findings, true), payload.fields, findings)
  if #pieces ~= #payload.fields then
    add_defect(findings, "field count")
    return nil
  end
  local texts, complete = {}, true
  for i, field in ipairs(payload.fields) do
    local text = FIELD[field.kind](field, pieces[i], findings)
    complete = complete and text ~= nil
    if payload.named and text then
      text = string.format("%s %s %s", field.label, text, field.unit):gsub(" +$", "")
    end
    texts[i] = text or ""
  end
  return complete and table.concat(texts, ", ") or nil
end

function PAYLOAD.optional_record(payload, piece, findings)
  piece = normalize(piece, findings, true)
  local flag, bar = piece.s:sub(1, 1), piece.s:sub(2, 2)
  if flag == "\0" or flag == "\1" then
    add_reading(findings, "runinfo_binary", "binary")
    if not payload.none_reading then
      add_defect(findings, "binary digit")
    end
    flag = flag == "\1" and "1" or "0"
  end
  if flag == "0" then
    local empty = ("|"):rep(#payload.fields)
    if bar == "" then
      if payload.none_reading then
        add_reading(findings, payload.none_reading, "0")
      end
    elseif payload.none_reading and piece.s:sub(2) == empty then
      add_reading(findings, payload.none_reading, "0||")
    else
      add_defect(findings, "flag")
    end
  elseif flag ~= "1" then
    add_defect(findings, "flag")
  elseif bar == " " or bar == "|" then
    if bar == " " then
      add_defect(findings, "space for bar")
    end
    return PAYLOAD.record(payload, sub(piece, 3, #piece.s), findings)
  else
    add_defect(findings, "field count")
  end
  return #findings.defects == 0 and "none" or nil
end

local function read_coded(piece, zero, findings)
  local separator = piece.s:sub(#zero + 1, #zero + 1)
  if separator == " " then
    add_defect(findings, "space for bar")
    add_reading(findings, "err_sep", "space")
  elseif separator ~= "|" then
    add_defect(findings, "field count")
    return nil
  end
  return read_code(sub(piece, #zero + 2, #piece.s), findings)
end

local function refused(word, code)
  return code and word .. " " .. code_text(code) or word
end

function PAYLOAD.first_reply(payload, piece, findings)
  piece = normalize(piece, findings, true)
  local s = piece.s
  if s == "\0" or s == "\1" then
    add_defect(findings, "binary digit")
  end
  if s == "1" or s == "\1" then
    add_field(findings, "uisr.accepted", piece, true)
    return "accepted"
  end
  local code
  if s == "0" or s == "\0" then
    if payload.bare_reading then
      add_reading(findings, payload.bare_reading, "0")
    elseif payload.has_code then
      add_defect(findings, "no code")
    end
  elseif s:sub(1, 1) == "0" and payload.has_code then
    if payload.bare_reading then
      add_reading(findings, payload.bare_reading, "0|code")
    end
    code = read_coded(piece, "0", findings)
  else
    add_defect(findings, "flag")
    if s:sub(1, 1) ~= "0" then
      return nil
    end
  end
  add_field(findings, "uisr.accepted", sub(piece, 1, 1), false)
  return refused("refused", code)
end

function PAYLOAD.final_result(_, piece, findings)
  piece = normalize(piece, findings, true)
  if piece.s == "11" then
    add_field(findings, "uisr.done", piece, true)
    return "done"
  end
  if piece.s:sub(1, 2) ~= "00" then
    add_defect(findings, "flag")
    return nil
  end
  add_field(findings, "uisr.done", sub(piece, 1, 2), false)
  return refused("failed", read_coded(piece, "00", findings))
end

function PAYLOAD.name_list(payload, piece, findings)
  if piece.s == "" then
    add_reading(findings, "list_empty", "empty")
    return "no programs"
  end
  piece = normalize(piece, findings, true)
  local flag, rest = piece.s:sub(1, 1), sub(piece, 2, #piece.s)
  if flag ~= "0" and flag ~= "1" then
    add_defect(findings, "flag")
    return nil
  end
  add_field(findings, payload.more, sub(piece, 1, 1), flag == "1")
  local texts = {}
  if rest.s == "" or rest.s == "|" then
    add_reading(findings, "list_empty", rest.s == "" and "0" or "0|")
  else
    local has_bar = rest.s:sub(1, 1) == "|"
    add_reading(findings, "list_prefix_sep", has_bar and "0|a" or "0a")
    local body, separator = has_bar and sub(rest, 2, #rest.s) or rest, "|"
    if rest.s:sub(1, 1) == " " and not rest.s:find("|", 1, true) then
      add_defect(findings, "space for bar")
      body, separator = sub(rest, 2, #rest.s), " "
    end
    if body.s:sub(-1) == separator then
      add_defect(findings, "trailing bar")
      body = sub(body, 1, #body.s - 1)
    end
    local seen, is_repeated = {}, false
    for i, name in ipairs(split(body, separator)) do
      texts[i] = FIELD.name({ filter = payload.name }, name, findings)
      is_repeated = is_repeated or seen[name.s]
      seen[name.s] = true
    end
    if is_repeated then
      add_defect(findings, "repeated name")
    end
  end
  local text = table.concat(texts, ", ")
  text = text == "" and "no programs" or text
  return flag == "1" and text .. ", …" or text
end

function PAYLOAD.optional_name(payload, piece, findings)
  piece = normalize(piece, findings, false)
  if piece.s == "" or piece.s == "0" then
    add_reading(findings, "default_none", piece.s == "0" and "0" or "empty")
    return #findings.defects == 0 and "none" or nil
  end
  return FIELD.name({ filter = payload.name }, piece, findings)
end

function PAYLOAD.jog(payload, piece, findings)
  if #piece.s ~= 1 then
    add_defect(findings, "size")
    return nil
  end
  local byte = piece.s:byte()
  local direction = SPEC.jog_directions[byte >= 0x30 and byte - 0x30 or byte]
  if not direction then
    add_defect(findings, "range")
    return nil
  end
  add_reading(findings, "jog_byte", byte >= 0x30 and "ascii" or "binary")
  add_field(findings, payload.direction, piece, direction)
  return direction
end

local function read_chunk(piece, order)
  local function number(at)
    local range = piece.tvb(piece.at + at, 4)
    return order == "little" and range:le_uint() or range:uint()
  end
  local chunk = { order = order, file_size = number(0), position = number(4), length = number(8) }
  chunk.sum = chunk.file_size + chunk.position + chunk.length
  chunk.data_bytes = math.min(chunk.length, #piece.s - 12)
  chunk.is_legal = chunk.length >= 1
    and chunk.length <= math.min(SPEC.buffer_bytes, #piece.s - 12)
    and chunk.position + chunk.length <= chunk.file_size
  return chunk
end

-- The structure fileData; the byte order is that in which the numbers are in bounds (A-5-2).
function PAYLOAD.file_data(payload, piece, findings)
  if #piece.s < 12 then
    add_defect(findings, "size")
    return nil
  end
  local little, big = read_chunk(piece, "little"), read_chunk(piece, "big")
  local chunk = big.sum < little.sum and big or little
  if little.is_legal ~= big.is_legal then
    chunk = little.is_legal and little or big
    add_reading(findings, "endian", chunk.order)
  end
  if #piece.s == 12 + SPEC.buffer_bytes then
    if chunk.length < SPEC.buffer_bytes then
      add_reading(findings, "chunk_trunc", "full")
    end
  elseif #piece.s == 12 + chunk.length then
    add_reading(findings, "chunk_trunc", "truncated")
  else
    add_defect(findings, "size")
  end
  if not chunk.is_legal then
    add_defect(findings, "chunk")
  end
  add_field(findings, payload.file_size, sub(piece, 1, 4), chunk.file_size)
  add_field(findings, payload.position, sub(piece, 5, 8), chunk.position)
  add_field(findings, payload.length, sub(piece, 9, 12), chunk.length)
  chunk.data = sub(piece, 13, 12 + chunk.data_bytes)
  findings.chunk = chunk
  return string.format(
    "%.0f bytes at %.0f of %.0f", chunk.data_bytes, chunk.position, chunk.file_size
  )
end
