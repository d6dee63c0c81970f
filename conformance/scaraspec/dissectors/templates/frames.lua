-- Frames (clause 3): find them in the bytes of one direction -----------------------------------

local SENDERS = {
  client = { start = 0x{{ "%02X" % client.start }}, stop = 0x{{ "%02X" % client.end }}, tag = -1 },
  controller = { start = 0x{{ "%02X" % controller.start }}, stop = 0x{{ "%02X" % controller.end }}, tag = SPEC.tag },
}

local function is_known(opcode, tagged)
  local command = COMMANDS[opcode]
  return command ~= nil and (command.result ~= nil or not tagged)
end

-- Finds frames and runs of invalid bytes from offset `at` on; all offsets begin with 0.
--
-- Arguments: the bytes; the sender; whether the first frame must have a known opcode, because
-- invalid bytes or a gap preceded; whether no more bytes follow, so that an unfinished frame is
-- invalid. Returns the items, the offset of an unfinished frame, and whether the next frame must
-- have a known opcode.
local function find_items(bytes, sender, unsynced, is_last)
  local side, size, at = SENDERS[sender], #bytes, 0
  local items, run_from, run_reason = {}, 0, "stray"
  local function end_run()
    if run_from < at then
      items[#items + 1] = { at = run_from, size = at - run_from, reason = run_reason }
    end
    run_from, run_reason = at, "stray"
  end
  local function skip(reason)
    if run_reason == "stray" then
      end_run()
      run_reason = reason
    end
    at = at + 1
  end
  while at < size do
    if bytes:byte(at + 1) ~= side.start then
      at = (bytes:find(string.char(side.start), at + 1, true) or size + 1) - 1
      unsynced = true
    else
      local tagged = bytes:byte(at + 2) == side.tag
      local head = at + (tagged and 4 or 3)
      local has_head = head <= size
      local stop = has_head and head + bytes:byte(head) or size
      local opcode = has_head and bytes:byte(head - 1)
      local plausible = not (unsynced and has_head) or is_known(opcode, tagged)
      if stop >= size and plausible then
        if not is_last then
          break
        end
        skip("truncated")
      elseif plausible and bytes:byte(stop + 1) == side.stop then
        end_run()
        items[#items + 1] = {
          at = at, size = stop + 1 - at, opcode = opcode, tagged = tagged, data_at = head,
        }
        at, unsynced = stop + 1, false
        run_from = at
      else
        skip(plausible and "bad end" or "implausible")
        unsynced = true
      end
    end
  end
  end_run()
  return items, at, unsynced
end
