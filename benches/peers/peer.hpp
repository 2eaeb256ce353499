// Common code of the peers: reader of the files of `bench export`, timing of single calls, one line of JSON per case.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace peer {

/// A file of little-endian u64 and f64; a text is its length and its bytes. Ends the process when the file is too short.
class Reader {
public:
    explicit Reader(const char *path) : path_(path), file_(std::fopen(path, "rb")) {
        if (!file_) fail("cannot be opened");
    }
    ~Reader() { std::fclose(file_); }
    Reader(const Reader &) = delete;

    std::uint64_t u64() {
        std::uint64_t value;
        bytes(&value, sizeof value);
        return value;
    }
    std::string text() {
        std::string value(u64(), '\0');
        bytes(value.data(), value.size());
        return value;
    }
    std::vector<std::string> texts() {
        std::vector<std::string> values(u64());
        for (auto &value : values) value = text();
        return values;
    }
    std::vector<double> f64s(std::size_t n) {
        std::vector<double> values(n);
        bytes(values.data(), n * sizeof(double));
        return values;
    }

private:
    void bytes(void *to, std::size_t n) {
        if (n > 0 && std::fread(to, 1, n, file_) != n) fail("is too short");
    }
    [[noreturn]] void fail(const char *what) {
        std::fprintf(stderr, "%s %s\n", path_, what);
        std::exit(2);
    }
    const char *path_;
    std::FILE *file_;
};

inline double now_ns() {
    return std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Time to read the clock twice; it is subtracted from every sample, as in `bench`.
inline double clock_ns() {
    std::vector<double> pauses(10001);
    for (auto &pause : pauses) {
        const double begin = now_ns();
        pause = now_ns() - begin;
    }
    std::nth_element(pauses.begin(), pauses.begin() + 5000, pauses.end());
    return pauses[5000];
}

/// Prevents the compiler from removing an unused result.
template <typename T> inline void keep(const T &value) { asm volatile("" : : "g"(&value) : "memory"); }

/// Times `run(i)` for i in 0..items, in `passes` passes after one untimed pass. `prepare(i)` runs before and `after(i)` after each call,
/// untimed.
template <typename Prepare, typename Run, typename After>
std::vector<double> time_each(std::size_t items, std::size_t passes, Prepare prepare, Run run, After after) {
    const double clock = clock_ns();
    std::vector<double> samples;
    samples.reserve(items * passes);
    for (std::size_t pass = 0; pass <= passes; ++pass) {
        for (std::size_t i = 0; i < items; ++i) {
            prepare(i);
            const double begin = now_ns();
            run(i);
            const double end = now_ns();
            after(i);
            if (pass > 0) samples.push_back(std::max(end - begin - clock, 0.0));
        }
    }
    return samples;
}

/// The line of a case: times in ns; `off`: relative difference of the results from ours; `unsolved`: number of calls without a solution.
inline void print(const std::string &name, std::vector<double> samples, double off, std::size_t unsolved = 0) {
    std::sort(samples.begin(), samples.end());
    const auto at = [&](double part) { return samples[static_cast<std::size_t>(part * (samples.size() - 1))]; };
    std::printf("{\"case\":\"%s\",\"calls\":%zu,\"min_ns\":%.1f,\"median_ns\":%.1f,\"p99_ns\":%.1f,\"off\":%.3e,\"unsolved\":%zu}\n",
                name.c_str(), samples.size(), samples[0], at(0.5), at(0.99), off, unsolved);
}

}  // namespace peer
