-- Streams: where a segment is in its direction of a connection ---------------------------------

-- State of each direction, in the order of the packets in the first pass:
--   position: offset after the last byte that was seen
--   unfinished: offset of an unfinished frame, or nil
--   unsynced: whether the next frame must have a known opcode
--   time, silence: time of the last bytes; offset of a long silence inside a frame, or nil
--   gaps: ranges that are missing so far
--   files: the file transfers, by opcode
local streams = {}
-- What the first pass found out about the bytes of a packet, for later passes.
local marks = {}

function uisr.init()
  streams, marks = {}, {}
end

-- Returns the last value of a field of TCP in this packet: an outer connection comes first. Returns
-- nil if there is none: Wireshark makes no fields while it loads a file.
local function last_info(field)
  local infos = { field() }
  return infos[#infos]
end

local function last_number(field)
  local info = last_info(field)
  return info and tonumber(tostring(info.value))
end

-- Returns the offset of a Tvb in its direction of the connection, or nil if it is not known.
local function position_of(bytes)
  local sequence, payload = last_number(seq_field), last_info(payload_field)
  if not sequence or not payload then
    return nil
  end
  payload = payload.range:raw()
  local before = #bytes - #payload
  if before < 0 or bytes:sub(before + 1) == payload then
    return sequence - 1 - before
  end
  -- Later segments that came earlier are part of the Tvb, too.
  local first = bytes:find(payload, 1, true)
  return first and sequence - first
end

local function new_state()
  -- A capture that begins within a connection may begin within a frame.
  local completeness = completeness_field and last_number(completeness_field)
  local opening_seen = not completeness or completeness % 4 > 0
  return { position = 0, unsynced = not opening_seen, gaps = {}, files = {} }
end

local function state_of(pinfo)
  local connection = last_number(stream_field)
    or table.concat({ tostring(pinfo.src), pinfo.src_port, tostring(pinfo.dst), pinfo.dst_port }, " ")
  local key = connection .. "/" .. pinfo.src_port
  streams[key] = streams[key] or new_state()
  return streams[key]
end

local function in_gap(state, position)
  for _, gap in ipairs(state.gaps) do
    if position >= gap[1] and position < gap[2] then
      return true
    end
  end
  return false
end

-- Returns whether a frame follows `prefix` unfinished bytes; a silence abandons these (A-3-11).
local function frame_follows(bytes, sender, prefix)
  local items = find_items(bytes:sub(prefix + 1), sender, true, false)
  return items[1] ~= nil and items[1].opcode ~= nil
end

-- Returns what the decoder must know about a Tvb:
--   key: identifies the Tvb
--   position: offset of the Tvb in its direction of the connection
--   repeated: all bytes were seen before
--   unsynced: the first frame must have a known opcode
--   prefix: so many bytes are an abandoned frame
--   files: contents of files whose last chunk is in the Tvb, by the offset of the frame
--   state: the state of the direction; only in the first pass
local function place(tvb, pinfo, bytes, sender)
  local key = pinfo.number .. "/" .. tvb:offset() .. "/" .. #bytes
  local position = position_of(bytes)
  if pinfo.visited then
    local mark = marks[key] or { key = key }
    mark.position = position or 0
    return mark
  end
  local state = state_of(pinfo)
  local is_reassembled = tvb:offset() == 0
  local expected = is_reassembled and state.unfinished or state.position
  position = position or expected
  local mark = { key = key, position = position, unsynced = state.unsynced, state = state }
  if position + tvb:reported_len() <= state.position and not in_gap(state, position) then
    mark.repeated = position ~= expected
  end
  if mark.repeated then
    marks[key] = mark
    return mark
  end
  if position > state.position then
    state.gaps[#state.gaps + 1] = { state.position, position }
  end
  if position ~= expected or (state.unfinished and not is_reassembled) then
    mark.unsynced = true
  elseif state.unfinished then
    if pinfo.rel_ts - state.time >= 2 then
      state.silence = state.position
    end
    local prefix = (state.silence or position) - position
    if prefix > 0 and frame_follows(bytes, sender, prefix) then
      mark.prefix = prefix
    end
  end
  state.time = pinfo.rel_ts
  if mark.prefix or mark.unsynced then
    marks[key] = mark
  end
  return mark
end

-- Returns the items of a Tvb and the offset of an unfinished frame; see `find_items`.
local function items_of(bytes, sender, mark, is_last)
  if not mark.prefix then
    return find_items(bytes, sender, mark.unsynced, is_last)
  end
  local items = find_items(bytes:sub(1, mark.prefix), sender, mark.unsynced, true)
  local rest, at, unsynced = find_items(bytes:sub(mark.prefix + 1), sender, true, is_last)
  for _, item in ipairs(rest) do
    item.at = item.at + mark.prefix
    item.data_at = item.data_at and item.data_at + mark.prefix
    items[#items + 1] = item
  end
  return items, at + mark.prefix, unsynced
end

-- Updates the state of a direction after the first pass over a Tvb.
local function advance(mark, tvb, at, unsynced)
  local state = mark.state
  local stop = mark.position + tvb:reported_len()
  if stop > state.position then
    local is_cut = tvb:reported_len() > tvb:len()
    state.position = stop
    state.unfinished = at < tvb:len() and mark.position + at or nil
    state.unsynced = unsynced or is_cut
  end
end

-- Collects the chunks of a file in the first pass. Stores the content of a complete file.
local function collect(mark, opcode, chunk, at)
  local files = mark.state.files
  local file = files[opcode]
  if chunk.is_legal and chunk.position == 0 then
    file = { size = chunk.file_size, next = 0, parts = {} }
    files[opcode] = file
  end
  if not file or chunk.position ~= file.next or chunk.file_size ~= file.size then
    return
  end
  file.parts[#file.parts + 1] = chunk.data.s
  file.next = file.next + chunk.data_bytes
  if file.next == file.size then
    files[opcode] = nil
    mark.files = mark.files or {}
    mark.files[at] = table.concat(file.parts)
    marks[mark.key] = mark
  end
end
