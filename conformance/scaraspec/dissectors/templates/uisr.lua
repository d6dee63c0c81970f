-- {{ marker }}: Wireshark dissector of the UISR4200S robot protocol.
-- Version {{ version }}. Do not edit: `scaraspec dissector --wireshark --install` replaces it.

local unpack = table.unpack or unpack
{{ spec }}
local COMMANDS = SPEC.commands

local uisr = Proto("uisr", "UISR4200S robot protocol")
uisr.prefs.port = Pref.uint("TCP port", SPEC.port, "The TCP port of the controller")

-- Fields by the name that display filters use.
local F = {}
for _, field in ipairs(SPEC.fields) do
  if field.type == "opcode" then
    F[field.filter] = ProtoField.uint8(field.filter, field.title, base.HEX, SPEC.opcode_titles)
  elseif field.type == "tag" then
    F[field.filter] = ProtoField.uint8(field.filter, field.title, base.HEX)
  elseif field.type == "node_type" then
    F[field.filter] = ProtoField.uint8(field.filter, field.title, base.DEC, SPEC.node_titles)
  else
    F[field.filter] = ProtoField[field.type](field.filter, field.title)
  end
end
uisr.fields = F

local EXPERT = {
  stray = ProtoExpert.new(
    "uisr.expert.stray", "Bytes that belong to no frame", expert.group.MALFORMED, expert.severity.WARN),
  length = ProtoExpert.new(
    "uisr.expert.length", "Wrong length: the end byte is elsewhere", expert.group.MALFORMED,
    expert.severity.ERROR),
  ending = ProtoExpert.new(
    "uisr.expert.end", "Missing end byte", expert.group.MALFORMED, expert.severity.ERROR),
  opcode = ProtoExpert.new(
    "uisr.expert.opcode", "Unknown opcode", expert.group.PROTOCOL, expert.severity.WARN),
  tag = ProtoExpert.new(
    "uisr.expert.tag", "Final result of a command that has none", expert.group.PROTOCOL,
    expert.severity.WARN),
  refusal = ProtoExpert.new(
    "uisr.expert.refusal", "Refused or failed", expert.group.RESPONSE_CODE, expert.severity.NOTE),
  undecodable = ProtoExpert.new(
    "uisr.expert.undecodable", "Undecodable data", expert.group.MALFORMED, expert.severity.ERROR),
  defect = ProtoExpert.new(
    "uisr.expert.defect", "Unusual data", expert.group.PROTOCOL, expert.severity.WARN),
}
uisr.experts = EXPERT

local stream_field, seq_field = Field.new("tcp.stream"), Field.new("tcp.seq")
local payload_field = Field.new("tcp.payload")
local has_completeness, completeness_field = pcall(Field.new, "tcp.completeness")
completeness_field = has_completeness and completeness_field or nil

{% include "text.lua" %}
{% include "fields.lua" %}
{% include "payloads.lua" %}
{% include "program.lua" %}
{% include "frames.lua" %}
{% include "stream.lua" %}
-- The tree -------------------------------------------------------------------------------------

-- Returns the command of a frame, its part, and the payload; nil if it is not defined.
local function lookup(sender, item, data)
  local command = COMMANDS[item.opcode]
  local other = SPEC.alternate_replies[item.opcode]
  if other and sender == "controller" and not item.tagged then
    local _, bars = data:gsub("|", "|")
    command = bars == other.bars and COMMANDS[other.opcode] or command
  end
  if not command then
    return nil
  end
  local part = item.tagged and "result" or sender == command.initiator and "request" or "reply"
  if not command[part] then
    return nil
  end
  return command, part, command[part]
end

-- Returns a range for a piece; the byte before an empty piece, which belongs to the frame.
local function range_of(piece)
  return #piece.s > 0 and piece.tvb(piece.at, #piece.s) or piece.tvb(piece.at - 1, 1)
end

local function add_findings(tree, findings, text)
  for _, field in ipairs(findings.fields) do
    local line = tree:add(F[field.name], range_of(field.piece), field.value)
    if field.note then
      line:append_text(" (" .. field.note .. ")")
    end
    if field.value == false and (field.name == "uisr.accepted" or field.name == "uisr.done") then
      tree:add_proto_expert_info(EXPERT.refusal, text)
    end
  end
  for _, defect in ipairs(findings.defects) do
    local line = tree:add(F["uisr.defect"], defect):set_generated()
    line:add_proto_expert_info(findings.undecodable and EXPERT.undecodable or EXPERT.defect, defect)
  end
  for _, reading in ipairs(findings.readings) do
    tree:add(F["uisr.reading"], reading):set_generated()
  end
end

-- Adds a frame to the tree; returns its text for the info column.
local function add_frame(tvb, tree, sender, item, mark, visited)
  local data_bytes = item.at + item.size - 1 - item.data_at
  local data = data_bytes > 0 and tvb:raw(item.data_at, data_bytes) or ""
  local piece = { tvb = tvb, at = item.data_at, s = data }
  local command, part, payload = lookup(sender, item, data)
  local secret = SPEC.secret_opcodes[item.opcode] and (sender == "client" or data_bytes > 1)
  local findings = new_findings(secret)
  local text = command and PAYLOAD[payload.kind](payload, piece, findings) or nil
  findings.undecodable = not text
  if not text or text == "" then
    text = data == "" and "" or show(piece)
  end
  text = secret and SPEC.password or cut_text(text)

  local name = command and command.name or string.format("0x%02X", item.opcode)
  local heading = command and name .. " " .. part or name
  local frame = tree:add(uisr, tvb(item.at, item.size), "UISR " .. heading .. ": " .. text)
  frame:add(F["uisr.sender"], tvb(item.at, 1), sender)
  if item.tagged then
    frame:add(F["uisr.tag"], tvb(item.at + 1, 1))
  end
  local opcode = frame:add(F["uisr.opcode"], tvb(item.data_at - 2, 1))
  frame:add(F["uisr.length"], tvb(item.data_at - 1, 1))
  if data ~= "" and not secret then
    frame:add(F["uisr.data"], tvb(item.data_at, data_bytes))
  end
  frame:add(F["uisr.command"], tvb(item.data_at - 2, 1), name):set_generated()
  if command then
    frame:add(F["uisr.part"], tvb(item.at, 1), part):set_generated()
  elseif COMMANDS[item.opcode] then
    opcode:add_proto_expert_info(EXPERT.tag)
  else
    opcode:add_proto_expert_info(EXPERT.opcode)
  end
  frame:add(F["uisr.text"], range_of(piece), text):set_generated()
  frame:add(F["uisr.position"], tvb(item.at, 1), UInt64(mark.position + item.at)):set_generated()
  add_findings(frame, findings, heading .. ": " .. text)
  if findings.chunk then
    if not visited then
      collect(mark, item.opcode, findings.chunk, item.at)
    end
    if mark.files and mark.files[item.at] then
      add_file(frame, mark.files[item.at])
    end
  end
  return text == "" and heading or heading .. ": " .. text
end

local function add_invalid(tvb, tree, sender, item)
  local range = tvb(item.at, item.size)
  local text = item.size .. " bytes that are no frame (" .. item.reason .. ")"
  local invalid = tree:add(uisr, range, "UISR " .. text)
  invalid:add(F["uisr.invalid"], range, item.reason)
  if item.reason ~= "bad end" then
    invalid:add_proto_expert_info(EXPERT.stray)
  elseif tvb(item.at + item.size - 1, 1):uint() == SENDERS[sender].stop then
    invalid:add_proto_expert_info(EXPERT.length)
  else
    invalid:add_proto_expert_info(EXPERT.ending)
  end
  return text
end

function uisr.dissector(tvb, pinfo, root)
  if tvb:len() == 0 then
    return 0
  end
  local sender = pinfo.dst_port == pinfo.match and "client" or "controller"
  local bytes = tvb:raw(0, tvb:len())
  local mark = place(tvb, pinfo, bytes, sender)
  local is_first = tostring(pinfo.cols.protocol) ~= "UISR"
  pinfo.cols.protocol = "UISR"
  if mark.repeated then
    return tvb:len()
  end
  local is_last = pinfo.can_desegment == 0
  local items, at, unsynced = items_of(bytes, sender, mark, is_last)
  if not pinfo.visited then
    advance(mark, tvb, at, unsynced)
  end
  for _, item in ipairs(items) do
    local add = item.opcode and add_frame or add_invalid
    local text = add(tvb, root, sender, item, mark, pinfo.visited)
    if is_first then
      pinfo.cols.info = text
    else
      pinfo.cols.info:append(" | " .. text)
    end
    pinfo.cols.info:fence()
    is_first = false
  end
  if at < tvb:len() then
    pinfo.desegment_offset = at
    pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
  end
  return tvb:len()
end

local tcp_ports, registered_port = DissectorTable.get("tcp.port"), nil

local function register_port()
  if registered_port ~= uisr.prefs.port then
    if registered_port then
      tcp_ports:remove(registered_port, uisr)
    end
    registered_port = uisr.prefs.port
    tcp_ports:add(registered_port, uisr)
  end
end

uisr.prefs_changed = register_port
register_port()
