-- Program files (clause 6) --------------------------------------------------------------------

local PROGRAM = SPEC.program

-- Reads numbers of a file in the byte order of a layout; `form` is b, B, i, I, q or f.
local function number_at(tvb, layout, form, at)
  local is_little = layout.order == "little"
  if form == "B" then
    return tvb(at, 1):uint()
  elseif form == "b" then
    return tvb(at, 1):int()
  elseif form == "f" then
    return is_little and tvb(at, 4):le_float() or tvb(at, 4):float()
  elseif form == "q" then
    return (is_little and tvb(at, 8):le_int64() or tvb(at, 8):int64()):tonumber()
  elseif form == "i" then
    return is_little and tvb(at, 4):le_int() or tvb(at, 4):int()
  end
  return is_little and tvb(at, 4):le_uint() or tvb(at, 4):uint()
end

local FORM_BYTES = { b = 1, B = 1, f = 4, i = 4, I = 4, q = 8 }

-- Returns the values of a node, its data form, and how many bytes the values have.
local function node_values(tvb, layout, at)
  local kind = PROGRAM.nodes[tvb(at + PROGRAM.type_offset, 1):uint()]
  local values, from = {}, at + layout.data_offset
  for i, form in ipairs(kind and kind.forms or {}) do
    form = form == "l" and (layout.long_bytes == 8 and "q" or "i") or form
    values[i] = number_at(tvb, layout, form, from)
    from = from + FORM_BYTES[form]
  end
  return values, kind, from - at
end

local function is_implausible(value)
  local size = math.abs(value)
  return not (value == 0 or (size >= PROGRAM.least and size <= PROGRAM.greatest))
end

-- Counts the values of a layout that are implausible, in the first nodes.
local function implausible_values(tvb, layout)
  local count, points = 0, number_at(tvb, layout, "I", layout.points_offset)
  local variables = number_at(tvb, layout, "I", layout.points_offset + 4)
  for i = 0, 8 do
    if is_implausible(number_at(tvb, layout, "f", layout.header_bytes + 4 * i)) then
      count = count + 1
    end
  end
  if tvb:raw(#PROGRAM.magic, layout.points_offset - #PROGRAM.magic):find("[^%z]") then
    count = count + 1
  end
  local start = layout.variables_offset + PROGRAM.variable_bytes * variables
  for i = 0, math.min(points, PROGRAM.sample) - 1 do
    local at = start + i * layout.node_bytes
    local values, kind, used = node_values(tvb, layout, at)
    if not kind then
      count = count + 1
    elseif kind.name == "POINT" then
      for _, value in ipairs(values) do
        count = count + (is_implausible(value) and 1 or 0)
      end
    elseif kind.name == "WAIT_TIMER" then
      local unused = tvb:raw(at + used, layout.node_bytes - used)
      count = count + ((values[2] < 0 or values[2] >= 1000000) and 1 or 0)
      count = count + ((values[1] < 0 or values[1] >= 2 ^ 32) and 1 or 0)
      count = count + (unused:find("[^%z]") and 1 or 0)
    end
  end
  return count
end

-- Returns the most plausible layout in which a file is a complete program, or nil (A-6.1-2).
local function detect_layout(tvb)
  local size, best, least = tvb:len(), nil, math.huge
  if size < #PROGRAM.magic or tvb:raw(0, #PROGRAM.magic) ~= PROGRAM.magic then
    return nil
  end
  for _, layout in ipairs(PROGRAM.layouts) do
    if size >= layout.variables_offset + #PROGRAM.footer then
      local points = number_at(tvb, layout, "I", layout.points_offset)
      local variables = number_at(tvb, layout, "I", layout.points_offset + 4)
      local nodes_end = layout.variables_offset
        + PROGRAM.variable_bytes * variables
        + layout.node_bytes * points
      if
        size == nodes_end + #PROGRAM.footer
        and tvb:raw(nodes_end, #PROGRAM.footer) == PROGRAM.footer
      then
        local count = implausible_values(tvb, layout)
        if count < least then
          best, least = layout, count
        end
      end
    end
  end
  return best
end

local function name_piece(tvb, at, size)
  local s = tvb:raw(at, size)
  local stop = s:find("%z")
  return { tvb = tvb, at = at, s = stop and s:sub(1, stop - 1) or s }
end

local function add_node(tree, tvb, layout, number, at)
  local values, kind = node_values(tvb, layout, at)
  local type_range = tvb(at + PROGRAM.type_offset, 1)
  local alias = show(name_piece(tvb, at, PROGRAM.type_offset))
  local name = kind and kind.name or "type " .. type_range:uint()
  local node = tree:add(uisr, tvb(at, layout.node_bytes), "Node " .. number .. ": " .. name)
  node:add(F["uisr.node.type"], type_range)
  node:add(F["uisr.node.alias"], tvb(at, PROGRAM.type_offset), alias)
  node:add(F["uisr.node.speed_rate"], tvb(at + PROGRAM.type_offset + 1, 1))
  node:add(F["uisr.node.counts"], tvb(at + PROGRAM.type_offset + 2, 1))
  local texts = {}
  for i, value in ipairs(values) do
    local digits = kind.forms[i] == "f" and "%.7g" or "%.0f"
    texts[i] = kind.names[i] .. " " .. string.format(digits, value):gsub(",", ".")
  end
  if #texts > 0 then
    local range = tvb(at + layout.data_offset, layout.node_bytes - layout.data_offset)
    node:add(F["uisr.node.values"], range, table.concat(texts, ", "))
    node:append_text(" (" .. table.concat(texts, ", ") .. ")")
  end
  if alias ~= "" then
    node:append_text(', "' .. alias .. '"')
  end
end

-- Adds a complete transferred file to the tree; its nodes, if it is a program.
local function add_file(tree, content)
  local tvb = ByteArray.new(content, true):tvb("Transferred file")
  local file = tree:add(uisr, tvb(), "Transferred file: " .. tvb:len() .. " bytes")
  local layout = detect_layout(tvb)
  if not layout then
    return
  end
  local points = number_at(tvb, layout, "I", layout.points_offset)
  local variables = number_at(tvb, layout, "I", layout.points_offset + 4)
  file:append_text(", program with " .. points .. " nodes")
  file:add(F["uisr.program.layout"], tvb(0, layout.header_bytes), layout.name):set_generated()
  file:add(F["uisr.program.points"], tvb(layout.points_offset, 4), points)
  file:add(F["uisr.program.variables"], tvb(layout.points_offset + 4, 4), variables)
  local at = layout.variables_offset
  for _ = 1, variables do
    local name = show(name_piece(tvb, at + 4, PROGRAM.variable_name_bytes))
    local variable = file:add(F["uisr.variable.name"], tvb(at, PROGRAM.variable_bytes), name)
    local value = number_at(tvb, layout, "i", at + 4 + PROGRAM.variable_name_bytes)
    variable:append_text(" (key " .. number_at(tvb, layout, "i", at) .. ") = " .. value)
    at = at + PROGRAM.variable_bytes
  end
  for number = 1, points do
    add_node(file, tvb, layout, number, at)
    at = at + layout.node_bytes
  end
end
