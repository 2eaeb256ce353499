// DAQP, a dual active-set solver, through its C interface: cold-started, and hot-started with the working set of the program before. The
// equality rows stay in the working set; with elimination by DAQP the programs of S1 take 13.5 µs instead of 7.8 µs.
#include "programs.hpp"

#include "api.h"
#include "utils.h"

#include <cstring>

using peer::Program;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

namespace {

/// A program in DAQP's arrays: bounds of the variables, then inequality rows, then equality rows.
struct Arrays {
    RowMajor H, A;
    Eigen::VectorXd f, upper, lower;
    std::vector<int> sense;
    DAQPProblem problem{};

    explicit Arrays(const Program &p) {
        const int n = p.g.size(), n_in = p.d.size(), n_eq = p.b.size(), m = n + n_in + n_eq;
        H.resize(n, n);
        A.resize(n_in + n_eq, n);
        f.resize(n);
        upper.resize(m);
        lower.resize(m);
        sense.assign(m, 0);
        std::fill(sense.begin() + n + n_in, sense.end(), DAQP_ACTIVE + DAQP_IMMUTABLE);
        load(p);
        problem = DAQPProblem{n, m, n, H.data(), f.data(), A.data(), upper.data(), lower.data(), sense.data(), nullptr, 0, 0};
    }
    void load(const Program &p) {
        const double inf = DAQP_INF;
        H = p.H;
        f = p.g;
        A << p.C, p.A;
        upper << p.upper.cwiseMin(inf), p.d, p.b;
        lower << p.lower.cwiseMax(-inf), Eigen::VectorXd::Constant(p.d.size(), -inf), p.b;
    }
};

void run(const std::vector<Program> &programs, std::size_t passes, const char *name, bool hot) {
    Arrays arrays(programs[0]);
    peer::Vector x(programs[0].g.size()), multipliers(arrays.problem.m);
    DAQPResult result{};
    result.x = x.data();
    result.lam = multipliers.data();
    DAQPWorkspace work{};
    allocate_daqp_settings(&work);
    work.settings->primal_tol = 1e-9;
    work.settings->eq_reduction = DAQP_EQ_REDUCTION_OFF;
    double setup = 0.0;
    if (setup_daqp(&arrays.problem, &work, &setup) < 0) {
        std::fprintf(stderr, "daqp: cannot be set up\n");
        std::exit(1);
    }
    const int all = DAQP_UPDATE_Rinv | DAQP_UPDATE_M | DAQP_UPDATE_v | DAQP_UPDATE_d;
    const int mask = hot ? all : all | DAQP_UPDATE_sense;
    peer::Tally tally;
    int flag = 0;
    auto samples = peer::time_each(
        programs.size(), passes, [&](std::size_t i) { arrays.load(programs[i]); },
        [&](std::size_t) {
            flag = daqp_update_ldp(mask, &work, &arrays.problem);
            if (flag >= 0) {
                daqp_solve(&result, &work);
                flag = result.exitflag;
            }
        },
        [&](std::size_t i) { tally.add(programs[i], flag > 0, x); });
    peer::print(name, std::move(samples), tally.off, tally.unsolved);
    free_daqp_workspace(&work);
    free_daqp_ldp(&work);
}

}  // namespace

int main(int argc, char **argv) {
    return peer::with_programs(argc, argv, [](const auto &programs, std::size_t passes) {
        run(programs, passes, "DAQP cold", false);
        run(programs, passes, "DAQP hot", true);
    });
}
