-- Decodes and encodes messages with the code that stock lcm-gen generates. Input: lines of type name and message in hexadecimal.
-- Output: the same.
for line in io.lines() do
    local name, hex = line:match("(%S+) (%S+)")
    local data = hex:gsub("%x%x", function(byte) return string.char(tonumber(byte, 16)) end)
    local message = require("hoofprint." .. name).decode(data)
    local out = message:encode():gsub(".", function(c) return string.format("%02x", c:byte()) end)
    print(name .. " " .. out)
end
