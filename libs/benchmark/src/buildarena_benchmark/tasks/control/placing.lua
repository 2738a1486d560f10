-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Looks, reaches over the cargo, lowers the gripper, lifts, swings over the mark, puts down, lets go.
local SHOULDER, ELBOW, UPPER, LOWER, GRIPPER = $shoulder, $elbow, $upper, $lower, $gripper
local ARM, FOREARM = $arm, $forearm
-- The least that still holds a piston out: asked for nothing, it goes back.
local HOLDS, LOOKS_S, DOWN = 1e-4, $looks, $down
local RAISES_S = 2.4
local seen = { count = 0, cargo = { x = 0, y = 0 }, goal = { x = 0, y = 0 }, ahead = { x = 0, y = 0 } }
local step, since = 1, 0
local asked = { [SHOULDER] = 0, [ELBOW] = 0 }

local function clip(value, most) return math.max(-most, math.min(most, value)) end

local function look(sense)
  seen.count = seen.count + 1
  local now = { cargo = sense.cargo.relative, goal = sense.marks.goal.relative, ahead = sense.forward }
  for name, at in pairs(now) do
    for _, axis in ipairs({ "x", "y" }) do
      seen[name][axis] = seen[name][axis] + (at[axis] - seen[name][axis]) / seen.count
    end
  end
end

-- The angles of shoulder and elbow, counted to the left, that bring the gripper over a place.
local function angles(place)
  local ahead = seen.ahead
  local y, left = place.x * ahead.x + place.y * ahead.y, place.y * ahead.x - place.x * ahead.y
  local cosine = (y * y + left * left - ARM ^ 2 - FOREARM ^ 2) / (2 * ARM * FOREARM)
  local elbow = math.acos(clip(cosine, 1))
  local inner = math.atan(FOREARM * math.sin(elbow), ARM + FOREARM * math.cos(elbow))
  return math.atan(left, y) - inner, elbow
end

-- Turns both joints towards a place; whether they are there.
local function reach(sense, answer, place)
  local shoulder, elbow = angles(place)
  local far = 0
  for joint, wanted in pairs({ [SHOULDER] = shoulder, [ELBOW] = elbow }) do
    local missing = wanted - sense.joints[joint].angle
    missing = missing - 2 * math.pi * math.floor(missing / (2 * math.pi) + 0.5)
    local share = clip($keen * missing, 1)
    asked[joint] = asked[joint] + clip(share - asked[joint], 0.04)
    answer[joint .. ".turn_left"] = asked[joint]
    far = math.max(far, math.abs(missing))
  end
  return far < 0.02
end

local function lower(sense, answer, most)
  local length = sense.joints[UPPER].length + sense.joints[LOWER].length
  local share = clip((most - length) / 3, 0.2)
  answer.extend = math.max(share, HOLDS)
  return most - length < 0.02
end

-- Back up: a piston that is asked for nothing returns fast, so one does after the other.
local function raise(answer, t)
  answer[LOWER .. ".extend"] = t < RAISES_S / 2 and HOLDS or 0
  return t > RAISES_S
end

local STEPS = {
  function(sense, answer, t) look(sense) return t > LOOKS_S end,
  function(sense, answer) return reach(sense, answer, seen.cargo) end,
  function(sense, answer) reach(sense, answer, seen.cargo) return lower(sense, answer, DOWN) end,
  function(sense, answer, t) return raise(answer, t) end,
  function(sense, answer) return reach(sense, answer, seen.goal) end,
  function(sense, answer, t) return reach(sense, answer, seen.goal) and t > 1 end,
  function(sense, answer) reach(sense, answer, seen.goal) return lower(sense, answer, DOWN - 0.08) end,
  function(sense, answer, t) answer.extend, answer[GRIPPER .. ".release"] = HOLDS, 1 return t > 0.5 end,
  function(sense, answer, t) answer[GRIPPER .. ".release"] = 1 raise(answer, t) end,
}

function control(t, sense)
  local answer = {}
  if STEPS[step](sense, answer, t - since) then step, since = step + 1, t end
  return answer
end
