// PIQP, a proximal interior-point solver, dense: each program updates the one before.
#include "programs.hpp"

#include <piqp/piqp.hpp>

int main(int argc, char **argv) {
    return peer::with_programs(argc, argv, [](const auto &programs, std::size_t passes) {
        piqp::DenseSolver<double> solver;
        // It does not reach tighter tolerances on three quarters of the programs of S1.
        solver.settings().eps_abs = 1e-9;
        solver.settings().eps_duality_gap_abs = 1e-9;
        auto p = programs[0];
        solver.setup(p.H, p.g, p.A, p.b, p.C, piqp::nullopt, p.d, p.lower, p.upper);
        peer::Tally tally;
        auto status = piqp::PIQP_SOLVED;
        auto samples = peer::time_each(
            programs.size(), passes, [&](std::size_t i) { p = programs[i]; },
            [&](std::size_t) {
                solver.update(p.H, p.g, p.A, p.b, p.C, piqp::nullopt, p.d, p.lower, p.upper);
                status = solver.solve();
            },
            [&](std::size_t i) { tally.add(programs[i], status == piqp::PIQP_SOLVED, solver.result().x); });
        peer::print("PIQP", std::move(samples), tally.off, tally.unsolved);
    });
}
