-- What a controller may use, and what it may cost. Read once for each program, before its text.
--
-- Nothing here depends on the process: tables are gone through in the order of their keys, tables and
-- functions have no address when written, random numbers come from the trial's seed. Nothing takes
-- long between two counted instructions but strings, which the clock bounds.
local seed, tick_limit, trial_limit, tick_clock_s, trial_clock_s = ...

local STEP = 25  -- instructions between two looks at the count and at the clock
local MODULUS, FACTOR = 2147483647, 48271  -- Park and Miller's; exact in doubles too

local raw_next, raw_type, raw_tostring, raw_error = next, type, tostring, error
local raw_tonumber, raw_select, raw_assert, raw_pcall = tonumber, select, assert, pcall
local raw_unpack, raw_concat, raw_sort, raw_ipairs = table.unpack, table.concat, table.sort, ipairs
local clock, floor, raw_min, raw_max = os.clock, math.floor, math.min, math.max
local read, set_hook = load, debug.sethook
debug.setmetatable("", nil)  -- ("x"):rep, patterns and sums of texts cannot be interrupted

local TOO_MANY, TOO_MANY_IN_ALL, TOO_LONG = {}, {}, {}  -- told apart by being themselves
local LONGEST_TEXT = 4096  -- bytes of what is joined or read as a number
local left, left_in_all = 0, trial_limit
local began_s = nil  -- when the clock was first looked at in this call

local function spend(instructions)
  left = left - instructions
  left_in_all = left_in_all - instructions
  if left < 0 then raw_error(TOO_MANY, 0) end
  if left_in_all < 0 then raw_error(TOO_MANY_IN_ALL, 0) end
  local now_s = clock()
  began_s = began_s or now_s
  if now_s - began_s > raw_min(tick_clock_s, trial_clock_s) then raw_error(TOO_LONG, 0) end
end

local function hook() spend(STEP) end

-- What stands in place of the senses of a program that shall read none.
local looked = false
local function look()
  looked = true
  raw_error("it reads a sense", 2)
end
local nothing = setmetatable({}, { __index = look, __newindex = look, __len = look })

-- Numbers, then texts, then true and false.
local RANK = { number = 1, string = 2, boolean = 3 }
local function before(a, b)
  local of_a, of_b = raw_type(a), raw_type(b)
  if of_a ~= of_b then return RANK[of_a] < RANK[of_b] end
  if of_a == "boolean" then return b and not a end
  return a < b
end

local function sorted_keys(t)
  if raw_type(t) ~= "table" then raw_error("a table is expected, got " .. raw_type(t), 3) end
  if t == nothing then look() end
  local keys, n = {}, 0
  for key in raw_next, t do
    if not RANK[raw_type(key)] then
      raw_error("a table with a " .. raw_type(key) .. " as a key has no order to go through", 3)
    end
    n = n + 1
    keys[n] = key
  end
  spend(n)
  raw_sort(keys, before)
  return keys
end

local function ordered_pairs(t)
  local keys, i = sorted_keys(t), 0
  return function()
    local key, value
    repeat
      i = i + 1
      key = keys[i]
      if key == nil then return nil end
      value = t[key]
    until value ~= nil  -- one that the loop took out
    return key, value
  end
end

local function ordered_next(t, after)
  local keys = sorted_keys(t)
  local found = after == nil
  for _, key in raw_ipairs(keys) do
    if found then return key, t[key] end
    found = key == after
  end
  if not found then raw_error("the table has no such key", 2) end
  return nil
end

local function plain_tostring(value)
  local kind = raw_type(value)
  if kind == "table" or kind == "function" then return kind end
  return raw_tostring(value)
end

local function insert(t, ...)
  local count, length = raw_select("#", ...), #t
  if count == 1 then
    t[length + 1] = (...)
    return
  end
  if count ~= 2 then raw_error("table.insert takes a table, a place and a value", 2) end
  local place, value = ...
  if raw_type(place) ~= "number" or place < 1 or place > length + 1 or place ~= floor(place) then
    raw_error("table.insert: the place is out of bounds", 2)
  end
  for i = length, place, -1 do t[i + 1] = t[i] end
  t[place] = value
end

local function remove(t, place)
  local length = #t
  place = place or length
  local value = t[place]
  if length == 0 then return value end
  if raw_type(place) ~= "number" or place < 1 or place > length + 1 or place ~= floor(place) then
    raw_error("table.remove: the place is out of bounds", 2)
  end
  for i = place, length do t[i] = t[i + 1] end
  return value
end

local MOST_TOGETHER = 1000
local function concat(t, between, first, last)
  first, last = first or 1, last or #t
  if last - first >= MOST_TOGETHER then
    raw_error("table.concat joins " .. MOST_TOGETHER .. " texts at most", 2)
  end
  spend(last - first + 1)
  local joined = raw_concat(t, between, first, last)
  if #joined > LONGEST_TEXT then
    raw_error("table.concat makes texts of " .. LONGEST_TEXT .. " bytes at most", 2)
  end
  return joined
end

local function unpack(t, first, last)
  first, last = first or 1, last or #t
  if last - first >= 250 then raw_error("table.unpack gives 250 values at most", 2) end
  return raw_unpack(t, first, last)
end

local function own_tonumber(value, base)
  if raw_type(value) == "string" and #value > LONGEST_TEXT then
    raw_error("tonumber reads texts of " .. LONGEST_TEXT .. " bytes at most", 2)
  end
  if base == nil then return raw_tonumber(value) end
  return raw_tonumber(value, base)
end

local drawn = seed % (MODULUS - 1) + 1
local function random(low, high)
  drawn = drawn * FACTOR % MODULUS
  local share = (drawn - 1) / (MODULUS - 1)
  if low == nil then return share end
  if high == nil then low, high = 1, low end
  if low > high then raw_error("math.random: the range is empty", 2) end
  return low + floor(share * (high - low + 1))
end

-- What interpreters do each in their own way; the game's has a `fmod`, `modf` and `huge` of its own.
local atan2, log, abs, ceil, infinite = math.atan2, math.log, math.abs, math.ceil, 1 / 0
local own_math = { random = random, pi = math.pi, huge = infinite }

function own_math.atan(y, x) return atan2(y, x or 1) end
own_math.atan2 = atan2

function own_math.log(x, base)
  if base == nil then return log(x) end
  return log(x) / log(base)
end

function own_math.fmod(a, b)
  local rest = abs(a) % abs(b)
  return a < 0 and -rest or rest
end

function own_math.modf(x)
  if abs(x) == infinite then return x, 0 end
  local whole = x < 0 and ceil(x) or floor(x)
  return whole, x - whole
end

for _, name in raw_ipairs({
  "abs", "acos", "asin", "ceil", "cos", "exp", "floor", "max", "min", "sin", "sqrt", "tan",
}) do
  own_math[name] = math[name]
end

local environment = {
  math = own_math,
  table = { insert = insert, remove = remove, concat = concat, unpack = unpack },
  pairs = ordered_pairs, ipairs = raw_ipairs, next = ordered_next, type = raw_type,
  tonumber = own_tonumber, tostring = plain_tostring, select = raw_select, error = raw_error,
  assert = raw_assert,
}
environment._G = environment

local function counted(called, ...)
  set_hook(hook, "", STEP)
  local ok, result = raw_pcall(called, ...)
  set_hook()
  return ok, result
end

-- Every call of the program goes through here: what went wrong is a text, whatever was thrown. The
-- outer pcall is for the hook, which may fire once more before it is taken away.
local function bounded(called, ...)
  left, began_s = tick_limit, nil
  local whole, ok, result = raw_pcall(counted, called, ...)
  if not whole then
    set_hook()
    ok, result = false, ok
  end
  if began_s then trial_clock_s = raw_max(trial_clock_s - (clock() - began_s), 0) end
  if ok then return true, result end
  if result == TOO_MANY then return false, "instructions" end
  if result == TOO_MANY_IN_ALL then return false, "instructions_in_all" end
  if result == TOO_LONG then return false, "clock" end
  if raw_type(result) == "string" then return false, "error", result end
  return false, "error", "it threw a " .. raw_type(result)
end

local make_senses, latest = nil, nil

local driver = {}

function driver.read(text)
  local chunk, message = read(text, "=controller", "t", environment)
  if not chunk then return false, "syntax", message end
  local ok, why, message = bounded(chunk)
  if not ok then return false, why, message end
  if raw_type(environment.control) ~= "function" then
    return false, "error", "the program has no function control(t, sense)"
  end
  return true
end

-- The ids that the program listed as `sensors`; nil where it is no list of texts.
function driver.sensors(most)
  local listed, result = environment.sensors, {}
  if listed == nil then return "" end
  if raw_type(listed) ~= "table" then return nil end
  for i = 1, most + 1 do
    local id = listed[i]
    if id == nil then break end
    if raw_type(id) == "number" then id = raw_tostring(id) end
    if raw_type(id) ~= "string" then return nil end
    result[i] = id
  end
  if #result == 0 then return "" end
  return raw_unpack(result)
end

function driver.senses_are(source)
  make_senses = raw_assert(read(source, "=senses", "t", {}))()
end

function driver.sense_nothing()
  make_senses = function() return nothing end
  latest = {}
end

function driver.looked() return looked end

function driver.take(...)
  latest = { ... }
end

function driver.more(...)
  local count, further = #latest, { ... }
  for i = 1, #further do latest[count + i] = further[i] end
end

-- What the program answers: true and its names and values in turn, or false and why not.
function driver.answer(time_s, most, longest)
  local ok, why, message = bounded(environment.control, time_s, make_senses(latest))
  if not ok then return false, why, message end
  local answer = why
  if answer == nil then return true end
  if raw_type(answer) ~= "table" then
    return false, "answer", "it answers a " .. raw_type(answer) .. " in place of a table"
  end
  local flat, n = {}, 0
  for name, value in raw_next, answer do
    if n >= 2 * most then return false, "answer", "it answers more than " .. most .. " names" end
    if raw_type(name) ~= "string" then
      return false, "answer", "a name that it answers is a " .. raw_type(name)
    end
    if #name > longest then
      return false, "answer", "a name that it answers has more than " .. longest .. " bytes"
    end
    if value == true then value = 1 elseif value == false then value = 0 end
    if raw_type(value) ~= "number" then
      return false, "answer", "what it answers for " .. name .. " is a " .. raw_type(value)
    end
    flat[n + 1], flat[n + 2] = name, value
    n = n + 2
  end
  return true, raw_unpack(flat)
end

return driver
