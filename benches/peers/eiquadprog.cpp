// eiquadprog, TSID's solver: Goldfarb and Idnani's dual method, always cold-started. It accepts neither zero nor dependent equality rows and
// no bounds; zero rows are removed and bounds are converted to rows outside the timed call.
#include "programs.hpp"

#include <eiquadprog/eiquadprog-fast.hpp>

using namespace eiquadprog::solvers;
using peer::Matrix;
using peer::Program;
using peer::Vector;

namespace {

/// CE x + ce0 = 0, CI x + ci0 >= 0.
struct Rows {
    Matrix H, CE, CI;
    Vector g, ce0, ci0;

    void load(const Program &p) {
        const auto n = p.g.size();
        H = p.H;
        g = p.g;
        std::vector<Eigen::Index> there;
        for (Eigen::Index row = 0; row < p.A.rows(); ++row) {
            if (!p.A.row(row).isZero(0.0)) there.push_back(row);
        }
        CE.resize(there.size(), n);
        ce0.resize(there.size());
        for (std::size_t k = 0; k < there.size(); ++k) {
            CE.row(k) = p.A.row(there[k]);
            ce0[k] = -p.b[there[k]];
        }
        const auto finite = (p.lower.array() > -1e30).count() + (p.upper.array() < 1e30).count();
        CI = Matrix::Zero(p.C.rows() + finite, n);
        ci0.resize(CI.rows());
        CI.topRows(p.C.rows()) = -p.C;
        ci0.head(p.C.rows()) = p.d;
        auto row = p.C.rows();
        for (Eigen::Index i = 0; i < n; ++i) {
            if (p.lower[i] > -1e30) {
                CI(row, i) = 1.0;
                ci0[row++] = -p.lower[i];
            }
            if (p.upper[i] < 1e30) {
                CI(row, i) = -1.0;
                ci0[row++] = p.upper[i];
            }
        }
    }
};

}  // namespace

int main(int argc, char **argv) {
    return peer::with_programs(argc, argv, [](const auto &programs, std::size_t passes) {
        Rows rows;
        EiquadprogFast solver;
        Vector x(programs[0].g.size());
        peer::Tally tally;
        auto status = EIQUADPROG_FAST_OPTIMAL;
        Eigen::Index n_eq = -1;
        auto samples = peer::time_each(
            programs.size(), passes,
            [&](std::size_t i) {
                rows.load(programs[i]);
                if (rows.CE.rows() != n_eq) {
                    n_eq = rows.CE.rows();
                    solver.reset(x.size(), n_eq, rows.CI.rows());
                }
            },
            [&](std::size_t) { status = solver.solve_quadprog(rows.H, rows.g, rows.CE, rows.ce0, rows.CI, rows.ci0, x); },
            [&](std::size_t i) { tally.add(programs[i], status == EIQUADPROG_FAST_OPTIMAL, x); });
        peer::print("eiquadprog", std::move(samples), tally.off, tally.unsolved);
    });
}
