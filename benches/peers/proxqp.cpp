// ProxQP, a proximal augmented Lagrangian solver, dense: cold-started, and warm-started with the solution before.
#include "programs.hpp"

#include <proxsuite/proxqp/dense/dense.hpp>

using namespace proxsuite::proxqp;
using peer::Program;
using peer::Vector;

namespace {

/// Bounds as rows after C: a warm start has no multipliers of bounds.
void with_bounds_as_rows(Program &p, Vector &low) {
    const auto n = p.g.size(), n_in = p.d.size();
    p.C.conservativeResize(n_in + n, n);
    p.C.bottomRows(n).setIdentity();
    p.d.conservativeResize(n_in + n);
    p.d.tail(n) = p.upper;
    low.resize(n_in + n);
    low << Vector::Constant(n_in, -1e20), p.lower;
}

void run(const std::vector<Program> &programs, std::size_t passes, const char *name, bool warm) {
    const auto n = programs[0].g.size();
    Program p = programs[0];
    Vector low;
    with_bounds_as_rows(p, low);
    dense::QP<double> qp(n, p.b.size(), p.d.size());
    qp.settings.eps_abs = 1e-9;
    qp.settings.eps_rel = 0.0;
    qp.settings.max_iter = 1000;
    peer::Tally tally;
    Vector x = Vector::Zero(n), y = Vector::Zero(p.b.size()), z = Vector::Zero(p.d.size());
    auto samples = peer::time_each(
        programs.size(), passes,
        [&](std::size_t i) {
            p = programs[i];
            with_bounds_as_rows(p, low);
            x = qp.results.x;
            y = qp.results.y;
            z = qp.results.z;
        },
        [&](std::size_t) {
            qp.settings.initial_guess =
                warm ? InitialGuessStatus::WARM_START : InitialGuessStatus::EQUALITY_CONSTRAINED_INITIAL_GUESS;
            qp.init(p.H, p.g, p.A, p.b, p.C, low, p.d);
            if (warm) qp.solve(x, y, z);
            else qp.solve();
        },
        [&](std::size_t i) { tally.add(programs[i], qp.results.info.status == QPSolverOutput::PROXQP_SOLVED, qp.results.x); });
    peer::print(name, std::move(samples), tally.off, tally.unsolved);
}

}  // namespace

int main(int argc, char **argv) {
    return peer::with_programs(argc, argv, [](const auto &programs, std::size_t passes) {
        run(programs, passes, "ProxQP cold", false);
        run(programs, passes, "ProxQP warm", true);
    });
}
