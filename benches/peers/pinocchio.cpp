// Pinocchio on the states of a file that `bench export` wrote: the same quantities as in this project, each by its fastest call, and all quantities of a tick.
//
//     pinocchio MODEL.txt STATES PASSES
//
// MODEL.txt is Pinocchio's archive of the robot; scripts/bench_peers.sh makes it from the URDF. The file of states also has our values: each
// quantity is transformed to our base velocity in W axes and compared; the largest difference relative to the largest entry is printed.
#include "peer.hpp"

#include <pinocchio/multibody.hpp>
#include <pinocchio/multibody/joint.hpp>

#include <pinocchio/algorithm/center-of-mass.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/serialization.hpp>

#include <fstream>

namespace pin = pinocchio;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

constexpr auto ALIGNED = pin::LOCAL_WORLD_ALIGNED;

/// One state and our values.
struct Case {
    VectorXd q, v;
    MatrixXd X;  // v = X v_ours
    VectorXd h, dJv, com, momentum;
    MatrixXd M, J, A_G;
};

int main(int argc, char **argv) {
    if (argc != 4) {
        std::fprintf(stderr, "usage: pinocchio MODEL.txt STATES PASSES\n");
        return 2;
    }
    pin::Model model;
    pin::serialization::loadFromText(model, argv[1]);
    model.gravity.linear(Eigen::Vector3d(0, 0, -9.81));
    pin::Data data(model);
    const auto passes = static_cast<std::size_t>(std::atoi(argv[3]));
    const auto nv = model.nv;

    peer::Reader file(argv[2]);
    const auto joints = file.texts(), foot_links = file.texts();
    std::vector<pin::FrameIndex> feet;
    for (const auto &link : foot_links) feet.push_back(model.getFrameId(link, pin::BODY));
    const auto nf = static_cast<int>(feet.size());
    const auto vector = [&](int n) { return VectorXd(Eigen::Map<VectorXd>(file.f64s(n).data(), n)); };
    const auto matrix = [&](int m, int n) { return MatrixXd(Eigen::Map<MatrixXd>(file.f64s(m * n).data(), m, n)); };

    std::vector<Case> cases(file.u64());
    for (auto &c : cases) {
        const VectorXd p = vector(3), wxyz = vector(4), w_W = vector(3);
        const VectorXd q = vector(joints.size()), qd = vector(joints.size());
        const Eigen::Matrix3d R = Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).toRotationMatrix();
        c.q = VectorXd::Zero(model.nq);
        c.v = VectorXd::Zero(nv);
        c.X = MatrixXd::Zero(nv, nv);
        c.q.head<7>() << p, wxyz[1], wxyz[2], wxyz[3], wxyz[0];
        c.v.segment<3>(3) = R.transpose() * w_W;
        c.X.topLeftCorner<3, 3>() = c.X.block<3, 3>(3, 3) = R.transpose();
        for (std::size_t j = 0; j < joints.size(); ++j) {
            const auto &joint = model.joints[model.getJointId(joints[j])];
            c.q[joint.idx_q()] = q[j];
            c.v[joint.idx_v()] = qd[j];
            c.X(joint.idx_v(), 6 + j) = 1.0;
        }
        c.M = matrix(nv, nv);
        c.h = vector(nv);
        c.J = matrix(6 * nf, nv);
        c.dJv = vector(6 * nf);
        c.com = vector(6);
        c.A_G = matrix(6, nv);
        c.momentum = vector(6);
    }

    const VectorXd zero = VectorXd::Zero(nv);
    std::vector<Jacobian> J(nf, Jacobian::Zero(6, nv));
    std::vector<pin::Motion> dJv(nf);
    double off = 0.0;
    const auto compare = [&](const MatrixXd &found, const MatrixXd &ours) {
        off = std::max(off, (found - ours).cwiseAbs().maxCoeff() / std::max(1.0, ours.cwiseAbs().maxCoeff()));
    };
    const auto check_M = [&](const Case &c) {
        compare(c.X.transpose() * MatrixXd(data.M.selfadjointView<Eigen::Upper>()) * c.X, c.M);
    };
    const auto check_J = [&](const Case &c) {
        for (int f = 0; f < nf; ++f) compare(J[f] * c.X, c.J.middleRows(6 * f, 6));
    };
    const auto check_dJv = [&](const Case &c) {
        for (int f = 0; f < nf; ++f) compare(dJv[f].toVector(), c.dJv.segment(6 * f, 6));
    };
    const auto check_com = [&](const Case &c) {
        compare(data.com[0], c.com.head(3));
        compare(data.vcom[0], c.com.tail(3));
    };
    const auto foot_jacobians = [&] {
        for (int f = 0; f < nf; ++f) pin::getFrameJacobian(model, data, feet[f], ALIGNED, J[f]);
    };
    const auto foot_accelerations = [&] {
        for (int f = 0; f < nf; ++f) dJv[f] = pin::getFrameClassicalAcceleration(model, data, feet[f], ALIGNED);
    };
    const auto time = [&](const char *name, auto run, auto check) {
        off = 0.0;
        // getFrameJacobian writes only the columns of the joints above the frame.
        for (auto &j : J) j.setZero();
        auto samples = peer::time_each(
            cases.size(), passes, [](std::size_t) {}, [&](std::size_t i) { run(cases[i]); }, [&](std::size_t i) { check(cases[i]); });
        peer::print(name, std::move(samples), off);
    };

    time("pass", [&](const Case &c) { pin::forwardKinematics(model, data, c.q, c.v, zero); }, [](const Case &) {});
    time("foot_jacobians",
         [&](const Case &c) {
             pin::computeJointJacobians(model, data, c.q);
             foot_jacobians();
         },
         check_J);
    time("mass_matrix", [&](const Case &c) { pin::crba(model, data, c.q, pin::Convention::LOCAL); }, check_M);
    time("bias_force", [&](const Case &c) { pin::nonLinearEffects(model, data, c.q, c.v); },
         [&](const Case &c) { compare(c.X.transpose() * data.nle, c.h); });
    time("foot_accelerations",
         [&](const Case &c) {
             pin::forwardKinematics(model, data, c.q, c.v, zero);
             foot_accelerations();
         },
         check_dJv);
    time("com", [&](const Case &c) { pin::centerOfMass(model, data, c.q, c.v, false); }, check_com);
    time("centroidal", [&](const Case &c) { pin::ccrba(model, data, c.q, c.v); },
         [&](const Case &c) {
             compare(data.Ag * c.X, c.A_G);
             compare(data.hg.toVector(), c.momentum);
         });
    // All quantities that a tick needs, by the two ways that share most intermediate results; the faster one is the reference.
    const auto check_set = [&](const Case &c) {
        check_M(c);
        compare(c.X.transpose() * data.nle, c.h);
        check_J(c);
        check_dJv(c);
        compare(data.com[0], c.com.head(3));
        compare(data.vcom[0], c.com.tail(3));
    };
    time("set",
         [&](const Case &c) {
             pin::nonLinearEffects(model, data, c.q, c.v);
             pin::crba(model, data, c.q, pin::Convention::LOCAL);
             pin::forwardKinematics(model, data, c.q, c.v, zero);
             pin::computeJointJacobians(model, data);
             foot_jacobians();
             foot_accelerations();
             pin::centerOfMass(model, data, pin::VELOCITY, false);
         },
         check_set);
    time("set, crba in the world frame",
         [&](const Case &c) {
             pin::nonLinearEffects(model, data, c.q, c.v);
             pin::crba(model, data, c.q, pin::Convention::WORLD);  // also computes the joint Jacobians
             foot_jacobians();
             pin::forwardKinematics(model, data, c.q, c.v, zero);
             foot_accelerations();
             pin::centerOfMass(model, data, pin::VELOCITY, false);
         },
         check_set);
}
