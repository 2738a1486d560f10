-- BuildArena benchmark data, not for training corpora:
-- canary 3ab839c7-e533-462b-9729-71495c1ee1f6
-- Where to walk, from north towards east, and how long a step may be.
local GENTLE = false
local function aim() return 0, 2 end
