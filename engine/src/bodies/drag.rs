//! Air drag on bodies.

use super::dynamics::WrenchPartial;
use super::frames::{Frame, apply};
use nalgebra::{Const, Matrix3, SMatrix};
use num_dual::DualSVec64;
use pliant_math::inertia::BodyInertia;
use pliant_math::spatial::{Force, hat};
use pliant_math::{Real, Vec3};

/// A body that the air acts on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyDrag {
    /// The body.
    pub body: usize,
    /// Its numbers in θ, for the centre of mass.
    pub inertia: BodyInertia,
    /// Area times drag coefficient \[m²\].
    pub area: DragArea,
    /// Index in θ of the wind's three numbers [m/s], and after them the air's density [kg/m³] and viscosity [Pa·s].
    pub air: usize,
}

/// Area times drag coefficient \[m²\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DragArea {
    /// An entry of θ.
    Theta(usize),
    /// A number of the scene.
    Constant(f64),
}

/// f = −(6 η √(π A) + ½ ρ A |u|) u \[N\] at the centre of mass, u its velocity less the wind [m/s]; x = (u, ρ, η, A). |u| is given the slope
/// 0 at u = 0. The first part is Stokes' drag of a sphere that shows the area A, the second one of the drag coefficient that A holds.
///
/// No moment about the centre of mass, and the same to all sides: what turning alone meets, and an area that depends on the side that is
/// shown, are left out.
fn law<S: Real>(x: &[S; INPUTS]) -> Vec3<S> {
    let u = Vec3::new(x[0], x[1], x[2]);
    let square = u.dot(&u);
    let speed = if square.re() > 0.0 { square.sqrt() } else { S::zero() };
    let linear = x[VISCOSITY] * (x[AREA] * std::f64::consts::PI).sqrt() * 6.0;
    -(u * (linear + x[DENSITY] * x[AREA] * speed * 0.5))
}

const DENSITY: usize = 3;
const VISCOSITY: usize = 4;
const AREA: usize = 5;
const INPUTS: usize = 6;

/// Where a body meets the air: all about the frames' origin, in the world's axes.
struct Meeting {
    /// Its centre of mass.
    centre: Vec3<f64>,
    inputs: [f64; INPUTS],
}

impl BodyDrag {
    /// Whether it has a force.
    pub fn acts(&self, theta: &[f64]) -> bool {
        theta[self.air + DENSITY] != 0.0 || theta[self.air + VISCOSITY] != 0.0
    }

    /// Area times drag coefficient \[m²\].
    pub fn area(&self, theta: &[f64]) -> f64 {
        match self.area {
            DragArea::Theta(k) => theta[k],
            DragArea::Constant(area) => area,
        }
    }

    fn meeting(&self, theta: &[f64], frame: &Frame<f64>) -> Meeting {
        let own = Vec3::from_fn(|k, _| theta[self.inertia.first + 1 + k]);
        let centre = apply(&frame.rotation, &own) + frame.position;
        let u = frame.velocity.at(&centre) - Vec3::from_fn(|k, _| theta[self.air + k]);
        let [density, viscosity] = [DENSITY, VISCOSITY].map(|k| theta[self.air + k]);
        Meeting { centre, inputs: [u[0], u[1], u[2], density, viscosity, self.area(theta)] }
    }

    /// The wrench about the frames' origin.
    pub fn wrench(&self, theta: &[f64], frame: &Frame<f64>) -> Force<f64> {
        let at = self.meeting(theta, frame);
        Force::at(&at.centre, law(&at.inputs))
    }

    /// How it changes with the body's displacement and velocity: with centre c and u = v + ω × c − wind,
    /// ```text
    /// δu = δv + δω × c          for δV,       δf = ∂f/∂u δu,  δn = c × δf
    /// δc = d + φ × c,  δu = ω × δc   for ξ,   δn = c × δf + δc × f
    /// ```
    pub fn partial(&self, theta: &[f64], frame: &Frame<f64>) -> WrenchPartial {
        let at = self.meeting(theta, frame);
        let (f, slope) = slopes(&at.inputs);
        let by_u: Matrix3<f64> = slope.fixed_columns::<3>(0).into_owned();
        let mut by_point = SMatrix::<f64, 3, 6>::zeros();
        by_point.fixed_columns_mut::<3>(0).copy_from(&-hat(&at.centre));
        by_point.fixed_columns_mut::<3>(3).copy_from(&Matrix3::identity());
        let turned = by_u * hat(&frame.velocity.w);
        let mut out = WrenchPartial { body: self.body, displaced: Default::default(), moving: Default::default() };
        let lever = hat(&at.centre);
        for (to, force) in [(&mut out.displaced, turned * by_point), (&mut out.moving, by_u * by_point)] {
            to.fixed_rows_mut::<3>(0).copy_from(&(lever * force));
            to.fixed_rows_mut::<3>(3).copy_from(&force);
        }
        let carried = -hat(&f) * by_point;
        let mut moment = out.displaced.fixed_rows_mut::<3>(0);
        moment += carried;
        out
    }

    /// Calls `visit(index in θ, ∂W/∂θ)`, wrenches about the frames' origin, for all numbers that it depends on; without density and viscosity for these alone.
    pub fn visit_theta(&self, theta: &[f64], frame: &Frame<f64>, visit: &mut dyn FnMut(usize, Force<f64>)) {
        let at = self.meeting(theta, frame);
        for k in [DENSITY, VISCOSITY] {
            // the force is linear in both
            let mut unit = at.inputs;
            (unit[DENSITY], unit[VISCOSITY]) = (0.0, 0.0);
            unit[k] = 1.0;
            visit(self.air + k, Force::at(&at.centre, law(&unit)));
        }
        if !self.acts(theta) {
            return; // all others are factors of these
        }
        let (f, slope) = slopes(&at.inputs);
        let column = |k: usize| slope.column(k).into_owned();
        if let DragArea::Theta(k) = self.area {
            visit(k, Force::at(&at.centre, column(AREA)));
        }
        for k in 0..3 {
            visit(self.air + k, Force::at(&at.centre, -column(k)));
            let moved = frame.rotation.column(k).into_owned();
            let u = frame.velocity.w.cross(&moved);
            let change = Force::at(&at.centre, slope.fixed_columns::<3>(0) * u);
            visit(self.inertia.first + 1 + k, Force { n: change.n + moved.cross(&f), f: change.f });
        }
    }
}

/// f and ∂f/∂x of [`law`].
fn slopes(x: &[f64; INPUTS]) -> (Vec3<f64>, SMatrix<f64, 3, INPUTS>) {
    let dual: [DualSVec64<INPUTS>; INPUTS] = std::array::from_fn(|k| DualSVec64::from_re(x[k]).derivative(k));
    let f = law(&dual);
    let slope = SMatrix::from_fn(|r, c| f[r].eps.unwrap_generic(Const::<INPUTS>, Const::<1>)[c]);
    (f.map(|f| f.re), slope)
}

/// A quarter of the surface of the box with this mass \[kg\] and inertia about its centre [kg·m²], the mean area that it shows \[m²\] (Cauchy's
/// formula for convex bodies): with half edges a_i, m a_i²/3 = ½ tr I − I_i.
pub fn mean_area(mass: f64, about_centre: &Matrix3<f64>) -> f64 {
    let second = Matrix3::from_diagonal_element(0.5 * about_centre.trace()) - about_centre;
    let half = second.symmetric_eigenvalues().map(|s| (3.0 * s.max(0.0) / mass).sqrt());
    2.0 * (half[0] * half[1] + half[1] * half[2] + half[2] * half[0])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use approx::assert_relative_eq;
    use pliant_math::spatial::Motion;

    const AIR: usize = 10;

    /// A body turned and moving, in a wind.
    fn case() -> (BodyDrag, Vec<f64>, Frame<f64>) {
        let theta = vec![2.0, 0.1, -0.2, 0.3, 0.2, 0.3, 0.4, 0.0, 0.0, 0.0, 0.4, -0.3, 0.2, 1.2, 0.3, 0.05];
        let drag = BodyDrag { body: 0, inertia: BodyInertia { first: 0 }, area: DragArea::Theta(15), air: AIR };
        let rotation = nalgebra::Rotation3::from_euler_angles(0.4, -0.7, 1.1).into_inner();
        let velocity = Motion { w: Vec3::new(1.0, -2.0, 0.5), v: Vec3::new(3.0, 0.7, -1.4) };
        (drag, theta, Frame { rotation, position: Vec3::new(0.3, -0.6, 0.9), velocity, acceleration: Motion::zero() })
    }

    fn close(a: &Force<f64>, plus: &Force<f64>, minus: &Force<f64>, h: f64) {
        assert_relative_eq!(a.f, (plus.f - minus.f) / (2.0 * h), max_relative = 1e-7, epsilon = 1e-9);
        assert_relative_eq!(a.n, (plus.n - minus.n) / (2.0 * h), max_relative = 1e-7, epsilon = 1e-9);
    }

    fn of(column: &nalgebra::Vector6<f64>) -> Force<f64> {
        Force { n: column.fixed_rows::<3>(0).into_owned(), f: column.fixed_rows::<3>(3).into_owned() }
    }

    /// −½ ρ A |u|² along u: 0.5 · 1.2 · 0.05 · 25 = 0.75 N; and Stokes' −6 π η r u.
    #[test]
    fn the_force_is_half_density_area_and_speed_squared_and_that_of_stokes() {
        let (drag, mut theta, mut frame) = case();
        theta[AIR..AIR + 3].fill(0.0);
        theta[AIR + VISCOSITY] = 0.0;
        frame.velocity = Motion { w: Vec3::zeros(), v: Vec3::new(3.0, 0.0, 4.0) };
        let wrench = drag.wrench(&theta, &frame);
        assert_relative_eq!(wrench.f, Vec3::new(-0.45, 0.0, -0.6), max_relative = 1e-14);
        let centre = frame.rotation * Vec3::new(0.1, -0.2, 0.3) + frame.position;
        assert_relative_eq!(wrench.n, centre.cross(&wrench.f), max_relative = 1e-14);
        assert_relative_eq!(frame.velocity.dot(&wrench), -3.75, max_relative = 1e-14);
        let radius = 0.02;
        let mut oil = theta.clone();
        (oil[AIR + DENSITY], oil[AIR + VISCOSITY], oil[15]) = (0.0, 0.1, std::f64::consts::PI * radius * radius);
        let stokes = -6.0 * std::f64::consts::PI * 0.1 * radius * frame.velocity.v;
        assert_relative_eq!(drag.wrench(&oil, &frame).f, stokes, max_relative = 1e-14);
        // as fast as the wind
        theta[AIR..AIR + 3].copy_from_slice(&[3.0, 0.0, 4.0]);
        let partial = drag.partial(&theta, &frame);
        assert_eq!((drag.wrench(&theta, &frame).f.norm(), partial.moving.norm(), partial.displaced.norm()), (0.0, 0.0, 0.0));
    }

    /// A cube of edge 2 a shows ½ · 12 a² on average, whatever its mass.
    #[test]
    fn the_mean_area_of_a_cube_is_a_quarter_of_its_surface() {
        for (mass, a) in [(1.0, 0.1), (7.0, 0.02)] {
            let moment = mass * (2.0 * a) * (2.0 * a) / 6.0;
            assert_relative_eq!(mean_area(mass, &Matrix3::from_diagonal_element(moment)), 6.0 * a * a, max_relative = 1e-12);
        }
        // a plate without thickness shows half of one side
        let (mass, a) = (0.5, 0.1);
        let flat = mass * a * a / 3.0;
        let plate = Matrix3::from_diagonal(&Vec3::new(flat, flat, 2.0 * flat));
        assert_relative_eq!(mean_area(mass, &plate), 2.0 * a * a, max_relative = 1e-7);
    }

    #[test]
    fn partials_are_central_differences() {
        let (drag, theta, frame) = case();
        let (partial, h) = (drag.partial(&theta, &frame), 1e-6);
        for k in 0..6 {
            let unit = |sign: f64| {
                let e = |c: usize| if c == k { sign * h } else { 0.0 };
                Motion { w: Vec3::new(e(0), e(1), e(2)), v: Vec3::new(e(3), e(4), e(5)) }
            };
            let faster = |sign| drag.wrench(&theta, &Frame { velocity: frame.velocity + unit(sign), ..frame });
            close(&of(&partial.moving.column(k).into_owned()), &faster(1.0), &faster(-1.0), h);
            let moved = |sign| {
                let xi = unit(sign);
                let rotation = nalgebra::Rotation3::new(xi.w).into_inner() * frame.rotation;
                drag.wrench(&theta, &Frame { rotation, position: frame.position + xi.at(&frame.position), ..frame })
            };
            close(&of(&partial.displaced.column(k).into_owned()), &moved(1.0), &moved(-1.0), h);
        }
        let mut seen = Vec::new();
        drag.visit_theta(&theta, &frame, &mut |k, change| {
            let other = |sign: f64| {
                let mut theta = theta.clone();
                theta[k] += sign * h;
                drag.wrench(&theta, &frame)
            };
            close(&change, &other(1.0), &other(-1.0), h);
            seen.push(k);
        });
        seen.sort_unstable();
        assert_eq!(seen, [1, 2, 3, 10, 11, 12, 13, 14, 15]);
    }
}
