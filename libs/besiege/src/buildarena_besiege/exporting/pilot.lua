-- Lets a machine's program act: makes its senses of what the mod tells, and presses keys for what it
-- answers. Before this stand the tables that the script's writer fills in, and `environment`, the
-- text in which our own engines run programs; after it stands `sense`, in the order of the layout.
local HUGE = 1000000000  -- what is farther away is told as this
local abs, sqrt, atan2 = math.abs, math.sqrt, math.atan2

local infos, now, before = {}, {}, {}
local values, count = {}, 0
local history, levels, carry, down = {}, {}, {}, {}
local driver, failed, asked, sense = nil, false, {}, nil

local function put(value)
  count = count + 1
  values[count] = value
end

-- A direction of a block's own axes in east, north and up.
local function across(r, u, f, d)
  return r.x * d[1] + u.x * d[2] + f.x * d[3], r.z * d[1] + u.z * d[2] + f.z * d[3],
    r.y * d[1] + u.y * d[2] + f.y * d[3]
end

-- Where each block's centre is, and where its built east, north and up point now: 12 numbers.
local function look(last)
  local poses = {}
  for i = 1, #bodies do
    local body, info = bodies[i], infos[i]
    if info.destroyed() then
      poses[i] = last[i] or {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}
    else
      local p, r, u, f = info.position(), info.right(), info.up(), info.forward()
      local cx, cy, cz = across(r, u, f, body[2])
      local ex, ey, ez = across(r, u, f, body[3])
      local nx, ny, nz = across(r, u, f, body[4])
      local ux, uy, uz = across(r, u, f, body[5])
      poses[i] = {p.x + cx, p.z + cy, p.y + cz, ex, ey, ez, nx, ny, nz, ux, uy, uz}
    end
  end
  return poses
end

-- The turn from one pose to another: twice its sine along its axis, and twice its cosine.
local function turned(from, to)
  local x, y, z, trace = 0, 0, 0, 0
  for k = 4, 10, 3 do
    local a, b, c, d, e, f = from[k], from[k + 1], from[k + 2], to[k], to[k + 1], to[k + 2]
    x, y, z = x + b * f - c * e, y + c * d - a * f, z + a * e - b * d
    trace = trace + a * d + b * e + c * f
  end
  return x, y, z, trace - 1
end

local function spin(i)
  local x, y, z, cosine = turned(before[i], now[i])
  local sine = sqrt(x * x + y * y + z * z)
  if sine < 0.000000001 then
    return 0, 0, 0
  end
  local scale = rate * atan2(sine, cosine) / sine
  return scale * x, scale * y, scale * z
end

-- A vector of the machine as it was built, carried along by a block.
local function carried(pose, x, y, z)
  return pose[4] * x + pose[7] * y + pose[10] * z, pose[5] * x + pose[8] * y + pose[11] * z,
    pose[6] * x + pose[9] * y + pose[12] * z
end

local function put_three(x, y, z)
  put(x)
  put(y)
  put(z)
end

local function put_velocity(i)
  local a, b = before[i], now[i]
  put_three((b[1] - a[1]) * rate, (b[2] - a[2]) * rate, (b[3] - a[3]) * rate)
end

local function axes(i)
  local p = now[i]
  local x, y, z = spin(i)
  put_three(p[10], p[11], p[12])
  put_three(p[7], p[8], p[9])
  put_three(x, y, z)
  put_three(p[4] * x + p[5] * y + p[6] * z, p[7] * x + p[8] * y + p[9] * z,
    p[10] * x + p[11] * y + p[12] * z)
end

local function pose(i)
  local p = now[i]
  put_three(p[1], p[2], p[3])
  put_velocity(i)
  axes(i)
end

-- How fast a block turns on another about an axis of the machine as it was built.
local function relative_spin(own, base, axis)
  local ax, ay, az = carried(now[base], axis[1], axis[2], axis[3])
  local x, y, z = spin(own)
  local bx, by, bz = spin(base)
  return ax * (x - bx) + ay * (y - by) + az * (z - bz)
end

local function turn(own, base, axis, sign)
  local a, b = now[own], now[base]
  local relative = {0, 0, 0}
  for k = 4, 10, 3 do
    for j = 4, 10, 3 do
      relative[#relative + 1] = b[j] * a[k] + b[j + 1] * a[k + 1] + b[j + 2] * a[k + 2]
    end
  end
  local x, y, z, cosine = turned({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, relative)
  put(sign * atan2(x * axis[1] + y * axis[2] + z * axis[3], cosine))
  put(sign * relative_spin(own, base, axis))
end

local function shift(poses, own, base, axis, arm, base_arm)
  local a, b = poses[own], poses[base]
  local x, y, z = carried(a, arm[1], arm[2], arm[3])
  local bx, by, bz = carried(b, base_arm[1], base_arm[2], base_arm[3])
  local ax, ay, az = carried(b, axis[1], axis[2], axis[3])
  return ax * (a[1] + x - b[1] - bx) + ay * (a[2] + y - b[2] - by) + az * (a[3] + z - b[3] - bz)
end

local function slide(own, base, axis, sign, arm, base_arm)
  local length = shift(now, own, base, axis, arm, base_arm)
  put(sign * length)
  put(sign * (length - shift(before, own, base, axis, arm, base_arm)) * rate)
end

-- On flat ground alone: a wheel touches it where its lowest point is near it.
local function wheel(own, base, axis, sign, radius, half_length)
  local _, _, az = carried(now[own], axis[1], axis[2], axis[3])
  local lowest = now[own][3] - radius * sqrt(math.max(1 - az * az, 0)) - half_length * abs(az)
  put(sign * relative_spin(own, base, axis))
  put(lowest < near_ground and 1 or 0)
end

local function cargo_moves(i)
  local p, own = now[i], now[1]
  put_three(p[1], p[2], p[3])
  put_three(p[1] - own[1], p[2] - own[2], p[3] - own[3])
  put_velocity(i)
end

local function place(x, y, z)
  local own = now[1]
  put_three(x, y, z)
  put_three(x - own[1], y - own[2], z - own[3])
end

local function next_gate(gates)
  local number = 1
  while number < #gates and gates[number][2] <= now[1][2] do
    number = number + 1
  end
  place(gates[number][1], gates[number][2], 0)
end

-- Normally distributed, of mean 0 and deviation 1.
local drawn = seed % 2147483646 + 1
local function normal()
  drawn = drawn * 48271 % 2147483647
  local first = drawn / 2147483647
  drawn = drawn * 48271 % 2147483647
  return sqrt(-2 * math.log(first)) * math.cos(6.283185307179586 * drawn / 2147483647)
end

local function rounded(value)
  if value ~= value then
    return 0
  end
  return floor(math.max(math.min(value, HUGE), -HUGE) * 1000000 + 0.5) / 1000000
end

-- Six decimals, put together from whole numbers.
local function micro(value)
  local sign = ""
  if value < 0 then
    sign, value = "-", -value
  end
  local whole = floor(value)
  local rest = floor((value - whole) * 1000000 + 0.5)
  if rest >= 1000000 then
    whole, rest = whole + 1, 0
  end
  local digits = format("%d", rest)
  return sign .. format("%d", whole) .. "." .. sub("000000", len(digits) + 1) .. digits
end

local function tell_tick(numbers)
  local parts = math.ceil(#numbers / numbers_per_line)
  for part = 1, parts do
    local text = ",p," .. format("%d", updates) .. "," .. format("%d", part)
      .. "," .. format("%d", parts)
    for i = (part - 1) * numbers_per_line + 1, math.min(part * numbers_per_line, #numbers) do
      text = text .. "," .. micro(numbers[i])
    end
    tell(text)
  end
end

local function get_ready()
  local info = machine.get_machine_info()
  for i = 1, #bodies do
    infos[i] = info.get_block_info(bodies[i][1])
  end
  local nothing = function() end
  local zero = function() return 0 end
  driver = environment({sethook = nothing, setmetatable = nothing}, {clock = zero}, zero,
    seed, tick_limit, trial_limit, 1, 1)
  failed = not driver.read(program)
  driver.senses_are(layout)
  for channel = 1, #keys do
    levels[channel], carry[channel], down[channel] = 0, 0, false
  end
end

local function ask_for(name, value)
  for _, channel in ipairs(named[name]) do
    asked[channel] = math.max(math.min(value, 1), -1)
  end
end

-- What its answer asks for: a name of one block counts in place of the name of all.
local function heed(answer)
  local levels_now = {}
  asked = {}
  for of_one = 0, 1 do
    for i = 2, #answer, 2 do
      if named[answer[i]] == nil or answer[i + 1] ~= answer[i + 1] then
        return false
      end
      if (single[answer[i]] and 1 or 0) == of_one then
        ask_for(answer[i], answer[i + 1])
      end
    end
  end
  for channel = 1, #keys do
    levels_now[channel] = 0
  end
  for channel = 1, #keys do
    local share = asked[channel] or 0
    local wanted = share < 0 and opposites[channel] or channel
    if wanted > 0 then
      levels_now[wanted] = math.max(levels_now[wanted], abs(share))
    end
  end
  levels = levels_now
  return true
end

local function act(tick)
  values, count = {}, 0
  sense()
  for i = 1, count do
    local deviation = noise[i]
    if deviation > 0 then
      values[i] = values[i] + deviation * normal()
    end
    values[i] = rounded(values[i])
  end
  history[tick] = values
  local told = history[math.max(tick - delay, 0)]
  driver.take()
  for first = 1, #told, 100 do
    driver.more(table.unpack(told, first, math.min(first + 99, #told)))
  end
  local answer = {driver.answer(tick / ticks_per_s, most_answers, longest_name)}
  failed = not (answer[1] and heed(answer))
  local numbers = {}
  for i = 1, #told do
    numbers[i] = told[i]
  end
  for channel = 1, failed and 0 or #keys do
    numbers[#numbers + 1] = rounded(levels[channel])
  end
  tell_tick(numbers)
  if failed then
    tell(",f," .. format("%d", updates))
  end
end

-- A share is a key that is down in that share of the updates, spread evenly.
local function is_on(channel)
  local level = levels[channel]
  if switches[channel] then
    return level > 0.5
  elseif level <= 0 then
    carry[channel] = 0
    return false
  end
  carry[channel] = carry[channel] + level
  if carry[channel] < 0.999999 then
    return false
  end
  carry[channel] = carry[channel] - 1
  return true
end

local function pilot()
  if updates == 1 then
    get_ready()
    now = look(now)
    before = now
  elseif updates % tick_updates >= tick_updates - 1 or updates % tick_updates == 0 then
    before = now
    now = look(now)
  end
  local over = failed or updates >= last
  if not over and (updates == 1 or updates % tick_updates == 0) then
    act(floor(updates / tick_updates))
    over = failed
  end
  for channel = 1, #keys do
    local on = not over and is_on(channel)
    if on ~= down[channel] then
      down[channel] = on
      if on then
        keys[channel].start()
      else
        keys[channel].stop()
      end
    end
  end
end
