// Quadratic programs of a file that `bench export` wrote, with our solution of each.
//
//     min ½ xᵀ H x + gᵀ x    subject to    A x = b,  C x <= d,  lower <= x <= upper
//
// All programs of a file have the same size; rows that are switched off are zero.
#pragma once

#include "peer.hpp"

#include <Eigen/Core>

namespace peer {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

struct Program {
    Matrix H;
    Vector g;
    Matrix A;
    Vector b;
    Matrix C;
    Vector d, lower, upper;
    Vector ours;
};

inline std::vector<Program> read_programs(const char *path) {
    Reader file(path);
    const auto vector = [&](std::size_t n) { return Vector(Eigen::Map<Vector>(file.f64s(n).data(), n)); };
    const auto matrix = [&](std::size_t m, std::size_t n) { return Matrix(Eigen::Map<Matrix>(file.f64s(m * n).data(), m, n)); };
    const auto n = file.u64(), n_eq = file.u64(), n_in = file.u64();
    std::vector<Program> programs(file.u64());
    for (auto &p : programs) {
        p.H = matrix(n, n);
        p.g = vector(n);
        p.A = matrix(n_eq, n);
        p.b = vector(n_eq);
        p.C = matrix(n_in, n);
        p.d = vector(n_in);
        p.lower = vector(n);
        p.upper = vector(n);
        p.ours = vector(n);
    }
    return programs;
}

/// Difference from our solution relative to its norm.
inline double off(const Program &p, const Vector &x) { return (x - p.ours).norm() / p.ours.norm(); }

/// Results of a solver: largest difference of a solution from ours, and number of calls without a solution.
struct Tally {
    double off = 0.0;
    std::size_t unsolved = 0;
    void add(const Program &p, bool solved, const Vector &x) {
        if (solved) off = std::max(off, peer::off(p, x));
        else ++unsolved;
    }
};

/// `main` of a solver: reads the arguments PROGRAMS and PASSES and calls `run`.
template <typename Run> int with_programs(int argc, char **argv, Run run) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: %s PROGRAMS PASSES\n", argv[0]);
        return 2;
    }
    run(read_programs(argv[1]), static_cast<std::size_t>(std::atoi(argv[2])));
    return 0;
}

}  // namespace peer
