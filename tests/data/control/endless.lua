-- Programs that would go on for ever, each after a line with its name.

--- a loop
while true do end

--- a loop of jumps
::again:: goto again

--- recursion
local function f() return 1 + f() end f()

--- tail calls
local function f() return f() end f()

--- mutual calls
local a, b
 a = function() return b() end b = function() return a() end a()

--- a wide table
local t = {} for i = 1, 1e9 do t[i] = i end

--- a deep table
local t = {} while true do t = { t } end

--- a growing text
local s = 'x' while true do s = s .. s end

--- a long text again and again
local s = 'x' for i = 1, 20 do s = s .. s end
while true do local y = s .. 'a' end

--- long texts compared
local s = 'x' for i = 1, 20 do s = s .. s end
local u = s .. 'b'
local v = s .. 'c'
while true do local y = u < v end

--- numbers of long texts
local s = '1' for i = 1, 20 do s = s .. s end
while true do local y = tonumber(s) end

--- insertion at the front
local t = {} while true do table.insert(t, 1, 0) end

--- removal at the front
local t = {} for i = 1, 9000 do t[i] = i end
while true do table.remove(t, 1) end

--- going through
local t = {} for i = 1, 900 do t[i] = i end
while true do for k in pairs(t) do end end

--- closures
local t = {} while true do t[#t + 1] = function() return t end end

--- concatenation
local t = {} for i = 1, 900 do t[i] = 'abcdefgh' end
while true do table.concat(t) end

--- random numbers
while true do math.random() end

--- a for without a step's end
for i = 1, math.huge do end

--- varargs
local function f(...) return f(1, ...) end f()
