//! Loops over slices with a fixed order of summation.

/// `Σ a_i b_i`: four partial sums, each over every fourth product, then their sum. The order is fixed, so the bits are fixed. Two SIMD lanes
/// of the baseline CPU can work in parallel, which a single sum in index order does not allow.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest = a4.remainder().iter().zip(b4.remainder());
    let mut sums = [0.0; 4];
    for (a, b) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    let sum = (sums[0] + sums[2]) + (sums[1] + sums[3]);
    rest.fold(sum, |sum, (a, b)| sum + a * b)
}

/// `y += s x`.
#[inline]
pub(crate) fn axpy(s: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += s * x;
    }
}
