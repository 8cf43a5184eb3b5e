//! The angle between two triangles that share an edge.

use crate::{Real, Vec3};

/// ψ = 2 tan(θ/2), θ the angle between the normals of triangles (x₀, x₁, x₂) and (x₁, x₀, x₃), and ∂ψ/∂x₀ … ∂ψ/∂x₃ [1/m].
///
/// Computed as −2 l e·(a × b)/(|n₁||n₂| + n₁·n₂) with a = x₂ − x₀, b = x₃ − x₀, n₁ = e × a, n₂ = b × e: no inverse cosine, no
/// cancellation near flat. Positive where the sheet bends away from the side its normals point to; ±∞ where it folds back
/// onto itself (θ = π). Not finite where a triangle has no area.
#[inline]
pub fn fold<S: Real>(x: &[Vec3<S>; 4]) -> (S, [Vec3<S>; 4]) {
    let (e, a, b) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    let (n1, n2) = (e.cross(&a), b.cross(&e));
    let (square1, square2, square) = (n1.dot(&n1), n2.dot(&n2), e.dot(&e));
    let l = square.sqrt();
    let psi = l * e.dot(&a.cross(&b)) * -2.0 / ((square1 * square2).sqrt() + n1.dot(&n2));
    // dψ = (1 + ψ²/4) dθ
    let slope = l * (psi * psi * 0.25 + 1.0);
    let (u, w) = (n1 * (slope / square1), n2 * (slope / square2));
    let (s, t) = (a.dot(&e) / square, b.dot(&e) / square);
    let x1 = u * s + w * t;
    (psi, [u + w - x1, x1, -u, -w])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent(theta: f64) -> [Vec3<f64>; 4] {
        // edge along y; the outer nodes at unequal heights and feet, the second one turned down by θ
        let (s, c) = theta.sin_cos();
        [Vec3::zeros(), Vec3::new(0.0, 0.5, 0.0), Vec3::new(-0.3, 0.1, 0.0), Vec3::new(0.2 * c, 0.7, -0.2 * s)]
    }

    #[test]
    fn is_twice_the_tangent_of_half_the_angle_down_to_the_last_digits() {
        for theta in [3.0, 1.0, 0.1, 1e-4, 1e-9, 1e-14, 0.0, -1e-9, -0.5] {
            let (psi, _) = fold(&bent(theta));
            let expected = 2.0 * (0.5 * theta).tan();
            assert!((psi - expected).abs() <= 4e-15 * expected.abs().max(1e-300), "{theta}: {psi} against {expected}");
        }
    }

    #[test]
    fn the_same_from_both_sides() {
        let x = bent(0.4);
        let (one, g) = fold(&x);
        let (two, k) = fold(&[x[1], x[0], x[3], x[2]]);
        assert!((one - two).abs() < 1e-15 && (g[3] - k[2]).norm() < 1e-13 && (g[0] - k[1]).norm() < 1e-13);
    }
}
