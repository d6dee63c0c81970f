-- Fields: one value of a payload ---------------------------------------------------------------

-- What a decoder finds: values of fields, defects, and readings of open points.
local function new_findings(secret)
  return { fields = {}, defects = {}, readings = {}, secret = secret }
end

local function add_field(findings, name, piece, value, note)
  findings.fields[#findings.fields + 1] = { name = name, piece = piece, value = value, note = note }
end

local function add_defect(findings, defect)
  findings.defects[#findings.defects + 1] = defect
end

local function add_reading(findings, point, option)
  findings.readings[#findings.readings + 1] = point .. "=" .. option
end

local function code_text(code)
  return code and code .. " " .. SPEC.codes[code] or ""
end

-- Each function decodes one kind of field. It returns the value as text, or nil if the bytes
-- cannot be decoded.
local FIELD = {}

function FIELD.number(field, piece, findings)
  local sign, digits, point, decimals = piece.s:match("^(%-?)(%d+)(%.?)(%d*)$")
  if not digits or (point == "") ~= (decimals == "") then
    add_defect(findings, "number")
    return nil
  end
  local value = tonumber(digits)
  if decimals ~= "" then
    value = value + tonumber(decimals) / 10 ^ #decimals
  end
  value = sign == "-" and -value or value
  add_field(findings, field.filter, piece, value)
  local text = string.format("%.10g", value):gsub(",", ".")
  return text
end

function FIELD.integer(field, piece, findings)
  local sign, digits = piece.s:match("^(%-?)0*(%d+)$")
  if not digits or #piece.s > 20 then
    add_defect(findings, "number")
    return nil
  end
  local value = tonumber(sign .. digits)
  if value < field.minimum or value > field.maximum then
    add_defect(findings, "range")
  end
  if math.abs(value) < 2 ^ 31 then
    add_field(findings, field.filter, piece, value)
  end
  return digits == "0" and "0" or sign .. digits
end

function FIELD.text(field, piece, findings)
  if piece.s == "" then
    add_defect(findings, "size")
  elseif piece.s:find("|", 1, true) then
    add_defect(findings, "bar in name")
  end
  add_field(findings, field.filter, piece, findings.secret and SPEC.password or show(piece))
  return show(piece)
end

function FIELD.name(field, piece, findings)
  local s = piece.s
  if s == "" then
    add_defect(findings, "empty name")
  end
  if s:find("|", 1, true) then
    add_defect(findings, "bar in name")
  end
  if #s > SPEC.name_bytes then
    add_defect(findings, "long name")
  end
  if s:find("[/\\%z]") or s == "." or s == ".." then
    add_defect(findings, "path in name")
  end
  add_field(findings, field.filter, piece, show(piece))
  return show(piece)
end

function FIELD.flag(field, piece, findings)
  local s = piece.s
  if s ~= "0" and s ~= "1" then
    if s ~= "\0" and s ~= "\1" then
      add_defect(findings, "flag")
      return nil
    end
    add_defect(findings, "binary digit")
  end
  local set = s == "1" or s == "\1"
  add_field(findings, field.filter, piece, set)
  add_field(findings, "uisr.accepted", piece, set)
  return set and "ok" or "refused"
end

local MONTH_DAYS = { 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31 }

function FIELD.clock(field, piece, findings)
  if not piece.s:match("^" .. ("%d"):rep(14) .. "$") then
    add_defect(findings, "clock")
    return nil
  end
  local texts = { piece.s:match("^(....)(..)(..)(..)(..)(..)$") }
  local year, month, day = tonumber(texts[1]), tonumber(texts[2]), tonumber(texts[3])
  local days = MONTH_DAYS[month] or 0
  if month == 2 and year % 4 == 0 and (year % 100 ~= 0 or year % 400 == 0) then
    days = 29
  end
  local is_day = year > 0 and day > 0 and day <= days
  if not is_day or texts[4] > "23" or texts[5] > "59" or texts[6] > "59" then
    add_defect(findings, "calendar")
    return nil
  end
  local text = string.format("%s-%s-%s %s:%s:%s", unpack(texts))
  add_field(findings, field.filter, piece, text)
  return text
end

function FIELD.run_time(field, piece, findings)
  local days, hours, minutes, seconds = piece.s:match("^(%d%d)(%d%d)(%d%d)(%d%d)$")
  if not days then
    add_defect(findings, "run time")
    return nil
  end
  if hours > "23" or minutes > "59" or seconds > "59" then
    add_defect(findings, "run time")
  end
  local value = ((days * 24 + hours) * 60 + minutes) * 60 + seconds
  add_field(findings, field.filter, piece, value)
  return string.format("%d", value)
end

function FIELD.address(field, piece, findings)
  local numbers = {}
  for _, part in ipairs(split(piece, ".")) do
    local is_number = part.s:match("^%d%d?%d?$") and tonumber(part.s) <= 255
    numbers[#numbers + 1] = is_number and string.format("%d", tonumber(part.s)) or nil
    if not is_number or #numbers > 4 then
      numbers = {}
      break
    end
  end
  if #numbers ~= 4 then
    add_defect(findings, "address")
    return nil
  end
  local text = table.concat(numbers, ".")
  add_field(findings, field.filter, piece, text)
  return text
end

local function read_code(piece, findings)
  local code = piece.s:upper()
  if not SPEC.codes[code] then
    add_defect(findings, "code")
    return nil
  end
  if SPEC.codes[code] == "reserved" then
    add_defect(findings, "reserved code")
  end
  add_field(findings, "uisr.code", piece, code, SPEC.codes[code])
  return code
end

function FIELD.status_code(field, piece, findings)
  local code = read_code(piece, findings)
  if not code then
    return nil
  end
  add_field(findings, field.filter, piece, code, SPEC.codes[code])
  return code_text(code)
end

function FIELD.bits(field, piece, findings)
  if #piece.s ~= field.count or piece.s:find("[^01]") then
    add_defect(findings, "bits")
    return nil
  end
  add_field(findings, field.filter, piece, piece.s)
  return piece.s
end

function FIELD.version(field, piece, findings)
  if piece.s == "" then
    add_defect(findings, "size")
  elseif not piece.s:match("^%d+%.%d+%.%d+$") then
    add_defect(findings, "version")
  end
  local text = show(piece, 255)
  add_field(findings, field.filter, piece, text)
  return text
end
