//! CDR, little-endian, as ROS 2 puts messages on the wire.
//!
//! ByteSource: OMG, *DDS Interoperability Wire Protocol* 2.5, §10.2 (plain CDR, version 1): every primitive is aligned to its own size,
//! counted from behind the four bytes of the header.

const HEADER: [u8; 4] = [0, 1, 0, 0];

/// Writes one message.
pub(super) struct Cdr(Vec<u8>);

impl Cdr {
    pub fn new() -> Self {
        Cdr(HEADER.to_vec())
    }

    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        let at = self.0.len() - HEADER.len();
        self.0.resize(HEADER.len() + at.next_multiple_of(N), 0);
        self.0.extend_from_slice(&bytes);
    }

    pub fn u8(&mut self, v: u8) {
        self.put([v]);
    }

    pub fn i8(&mut self, v: i8) {
        self.put(v.to_le_bytes());
    }

    pub fn i16(&mut self, v: i16) {
        self.put(v.to_le_bytes());
    }

    pub fn i32(&mut self, v: i32) {
        self.put(v.to_le_bytes());
    }

    pub fn u32(&mut self, v: u32) {
        self.put(v.to_le_bytes());
    }

    pub fn i64(&mut self, v: i64) {
        self.put(v.to_le_bytes());
    }

    pub fn f32(&mut self, v: f32) {
        self.put(v.to_le_bytes());
    }

    pub fn f64(&mut self, v: f64) {
        self.put(v.to_le_bytes());
    }

    /// Length with the NUL, bytes, NUL.
    pub fn string(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.0.extend_from_slice(text.as_bytes());
        self.0.push(0);
    }

    /// Number of elements of a sequence. No LCM message has so many that they do not fit.
    pub fn length(&mut self, n: usize) {
        self.u32(u32::try_from(n).unwrap_or(u32::MAX));
    }

    pub fn f64s(&mut self, values: &[f64]) {
        for &v in values {
            self.f64(v);
        }
    }

    /// `builtin_interfaces/Time`.
    pub fn time(&mut self, t_ns: i64) {
        let seconds = t_ns.div_euclid(1_000_000_000);
        self.i32(i32::try_from(seconds).unwrap_or(i32::MAX));
        self.u32(t_ns.rem_euclid(1_000_000_000) as u32);
    }

    /// `std_msgs/Header`.
    pub fn header(&mut self, t_ns: i64, frame: &str) {
        self.time(t_ns);
        self.string(frame);
    }

    /// `geometry_msgs/Quaternion`: x y z w.
    pub fn quaternion(&mut self, [w, x, y, z]: [f64; 4]) {
        self.f64s(&[x, y, z, w]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes by hand, from the rules of alignment.
    #[test]
    fn primitives_are_aligned_behind_the_header() {
        let mut cdr = Cdr::new();
        cdr.u8(1);
        cdr.f64(1.0);
        cdr.string("ab");
        cdr.i16(-2);
        #[rustfmt::skip]
        assert_eq!(cdr.bytes(), [
            0, 1, 0, 0,
            1, 0, 0, 0, 0, 0, 0, 0,
            0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
            3, 0, 0, 0, b'a', b'b', 0, 0,
            0xfe, 0xff,
        ]);
    }
}
