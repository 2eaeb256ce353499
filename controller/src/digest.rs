//! 64-bit digests over the bits of the quantities of a stage. If two digests are equal, the quantities are equal (up to hash collisions).

use lcmtypes::{RobotCommand, TickInput};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A running digest. Each word is mixed in by a rotation and a multiplication, and the finalizer of SplitMix64 ends it. This is fast enough for
/// every quantity of every tick. Long slices use four independent lanes, because the multiplications of a single lane depend on each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest(u64);

/// Shortest slice for which four lanes are faster than one.
const LANES_FROM: usize = 12;

impl Default for Digest {
    fn default() -> Self {
        Digest(0x9e37_79b9_7f4a_7c15)
    }
}

impl Digest {
    /// Mixes in a word.
    pub fn word(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x2545_f491_4f6c_dd1d);
    }

    /// Mixes in the bits of a number. `0.0` and `-0.0` give different digests, and so do NaNs with different payloads.
    pub fn f64(&mut self, x: f64) {
        self.word(x.to_bits());
    }

    /// Mixes in the bits of a slice, in order.
    pub fn f64s(&mut self, xs: &[f64]) {
        let fours = xs.chunks_exact(4);
        let rest = fours.remainder();
        if xs.len() >= LANES_FROM {
            let mut lanes = [0, 1, 2, 3].map(|lane| Digest(self.0 ^ lane));
            for four in fours {
                for (lane, x) in lanes.iter_mut().zip(four) {
                    lane.f64(*x);
                }
            }
            for lane in lanes {
                self.word(lane.0);
            }
        } else {
            for &x in &xs[..xs.len() - rest.len()] {
                self.f64(x);
            }
        }
        for &x in rest {
            self.f64(x);
        }
    }

    /// Mixes in a vector.
    pub fn vec3(&mut self, x: &Vector3<f64>) {
        self.f64s(x.as_slice());
    }

    /// Mixes in a 3x3 matrix, column by column.
    pub fn mat3(&mut self, x: &Matrix3<f64>) {
        self.f64s(x.as_slice());
    }

    /// Mixes in a vector of any size.
    pub fn dvec(&mut self, x: &DVector<f64>) {
        self.f64s(x.as_slice());
    }

    /// Mixes in a matrix of any size, column by column.
    pub fn dmat(&mut self, x: &DMatrix<f64>) {
        self.f64s(x.as_slice());
    }

    /// Returns the digest, as the signed integer of the messages.
    pub fn finish(self) -> i64 {
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)).cast_signed()
    }
}

/// Digest of a controller input.
pub fn input_digest(input: &TickInput) -> i64 {
    let TickInput { t_ns, tick, run_id, running, t_op_ns, n_ignored, n_late, state, op } = input;
    let mut d = Digest::default();
    let senders = [run_id, &state.sender_id, &op.sender_id, &op.t_mode_ns];
    for word in [t_ns, tick, running, t_op_ns, &state.t_ns, &state.seq, &op.t_ns, &op.seq].into_iter().chain(senders) {
        d.word(word.cast_unsigned());
    }
    d.word(u64::from(state.nj.cast_unsigned()));
    for values in [&state.q, &state.qd, &state.tau] {
        d.word(values.len() as u64);
        d.f64s(values);
    }
    for number in [n_ignored, n_late, &state.n_imus, &state.n_ft] {
        d.word(u64::from(number.cast_unsigned()));
    }
    d.f64s(state.q_WI_wxyz.as_flattened());
    for vectors in [&state.w_WI_I, &state.a_I, &state.f_S, &state.tau_S] {
        d.f64s(vectors.as_flattened());
    }
    d.word(u64::from(op.mode.cast_unsigned()));
    d.word(u64::from(op.gait.cast_unsigned()));
    d.f64s(&op.v_H);
    d.f64s(&[op.yaw_rate, op.roll, op.pitch, op.height_offset, op.swing_frequency, op.duty, op.step_height]);
    d.finish()
}

/// Digest of the command that leaves the controller.
pub fn command_digest(command: &RobotCommand) -> i64 {
    let RobotCommand { mode, tau, q_des, qd_des, kp, kd, .. } = command;
    let mut d = Digest::default();
    for values in [tau, q_des, qd_des, kp, kd] {
        d.f64s(values);
    }
    d.word(u64::from(mode.cast_unsigned()));
    d.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_and_the_order_change_the_digest() {
        let of = |xs: &[f64]| {
            let mut d = Digest::default();
            d.f64s(xs);
            d.finish()
        };
        let xs: Vec<f64> = [0.0, 1.5, -3.25, f64::NAN].into_iter().cycle().take(23).collect();
        for n in [4, LANES_FROM, 23] {
            let xs = &xs[..n];
            for i in 0..n {
                for bit in 0..64 {
                    let mut ys = xs.to_vec();
                    ys[i] = f64::from_bits(ys[i].to_bits() ^ (1 << bit));
                    assert_ne!(of(xs), of(&ys), "bit {bit} of word {i} of {n}");
                }
                // Swap neighbours within a lane and across lanes. A swap of equal numbers changes nothing.
                for step in [1, 4] {
                    let mut ys = xs.to_vec();
                    ys.swap(i, (i + step) % n);
                    let same = xs.iter().zip(&ys).all(|(x, y)| x.to_bits() == y.to_bits());
                    assert_eq!(of(xs) == of(&ys), same, "word {i} of {n} swapped with the one {step} after it");
                }
            }
        }
        let longer: Vec<f64> = [&xs[..], &[0.0]].concat();
        assert_ne!(of(&xs), of(&longer));
        assert_ne!(of(&[1.0, 2.0]), of(&[2.0, 1.0]));
        assert_ne!(of(&[0.0]), of(&[-0.0]));
        assert_ne!(of(&[1.0]), of(&[1.0, 0.0]));
    }
}
