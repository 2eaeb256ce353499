// Decodes and encodes messages with the code that stock lcm-gen generates. Input: lines of type name and message in hexadecimal.
// Output: the same.
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include "types.hpp" // written by tests/stock.rs: the headers of all types, and TYPES(X), an X for each

template <class T> void round_trip(const std::vector<unsigned char> &data) {
    T message;
    std::vector<unsigned char> out(data.size() + 64);
    if (message.decode(data.data(), 0, data.size()) < 0) { std::printf("not decoded\n"); return; }
    int n = message.encode(out.data(), 0, out.size());
    for (int i = 0; i < n; i++) std::printf("%02x", out[i]);
    std::printf("\n");
}

int main() {
    std::string name, hex;
    while (std::cin >> name >> hex) {
        std::vector<unsigned char> data;
        for (size_t i = 0; i + 1 < hex.size(); i += 2) data.push_back(std::stoi(hex.substr(i, 2), nullptr, 16));
        std::printf("%s ", name.c_str());
#define X(type) if (name == #type) round_trip<hoofprint::type>(data);
        TYPES(X)
#undef X
    }
}
