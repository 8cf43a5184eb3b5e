//! A driven pendulum integrated by a Runge–Kutta method of its own, and its logs with a scene that may lack something.

use pliant_identify::log::Setup;
use pliant_scene::Source;
use std::fmt::Write;
use tempfile::TempDir;

/// The true motion: I θ̈ = −w sin θ − b θ̇ − b₂ |θ̇| θ̇ − c sgn θ̇ − k (θ − p) − k₃ θ³ + a sin nθ + τ, read as θ(t) + bias + noise, with
/// the motor's τ = gain u(t − late) cut at ±limit, and of the spring k the plastic part ṗ = (θ − p)/creep.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    pub damping: f64,
    /// Part by which b grows from record to record.
    pub growth: f64,
    /// b₂ [N·m·s²/rad²].
    pub quadratic: f64,
    pub friction: f64,
    pub cubic: f64,
    /// a of the motor's cogging, [`CYCLES`] times per turn [N·m].
    pub cogging: f64,
    pub gain: f64,
    pub late: f64,
    pub bias: f64,
    pub noise: f64,
    pub limit: f64,
    pub spring: f64,
    pub creep: f64,
    /// Additional angle at the start [rad].
    pub turned: f64,
    /// Whether commands are held from sample to sample, else they go straight.
    pub held: bool,
    /// Whether the commands hold it near its top, by the angle and speed at each sample.
    pub balanced: bool,
    /// Length of a record [s].
    pub seconds: f64,
}

/// Inertia about the axis [kg·m²], and weight times lever [N·m]: 0.5 kg at 0.3 m.
pub const INERTIA: f64 = 0.045;
const WEIGHT: f64 = 0.5 * 9.81 * 0.3;
/// Cycles n of cogging per turn.
const CYCLES: u32 = 5;
/// Rate of the log [Hz], and steps of the truth per sample.
const RATE: f64 = 100.0;
const FINE: usize = 50;

impl Default for Truth {
    fn default() -> Self {
        Self {
            damping: 0.0,
            growth: 0.0,
            quadratic: 0.0,
            friction: 0.0,
            cubic: 0.0,
            cogging: 0.0,
            gain: 1.0,
            late: 0.0,
            bias: 0.0,
            noise: 1e-3,
            limit: 1e9,
            spring: 0.0,
            creep: 1e9,
            turned: 0.0,
            held: false,
            balanced: false,
            seconds: 4.0,
        }
    }
}

impl Truth {
    fn acceleration(&self, record: usize, [angle, speed, plastic]: [f64; 3], command: f64) -> f64 {
        let dry = if speed == 0.0 { 0.0 } else { self.friction * speed.signum() };
        let viscous = self.damping * (1.0 + self.growth * record as f64);
        let damped = (viscous + self.quadratic * speed.abs()) * speed;
        let spring = self.spring * (angle - plastic) + self.cubic * angle.powi(3);
        let cogging = self.cogging * (f64::from(CYCLES) * angle).sin();
        let torque = (self.gain * command).clamp(-self.limit, self.limit);
        (-WEIGHT * angle.sin() - damped - dry - spring + cogging + torque) / INERTIA
    }

    /// Columns t, angle, speed and command of a record.
    fn run(&self, record: usize, noise: &mut impl FnMut() -> f64) -> String {
        let command = |t: f64| {
            let k = record as f64;
            0.5 * (2.0 * t * (1.0 + 0.3 * k) + k).sin() + 0.25 * (7.3 * t + 2.0 * k).sin()
        };
        // a scene reads its log along straight lines, so the truth is driven by the same line
        let line = |t: f64, back: f64| {
            let k = (t * RATE + 1e-9).floor();
            let part = if self.held { 0.0 } else { t * RATE - k };
            (1.0 - part) * command(k / RATE) + part * command((k + 1.0) / RATE) + back
        };
        let h = 1.0 / RATE / FINE as f64;
        let mut x = [0.6 - 0.3 * record as f64 + self.turned, 0.2 * record as f64, 0.0];
        let mut out = "t,angle,command\n".to_owned();
        for sample in 0..=(self.seconds * RATE) as usize {
            let t = sample as f64 / RATE;
            let back = if self.balanced { 2.0 * WEIGHT * (std::f64::consts::PI - x[0]) - 0.2 * x[1] } else { 0.0 };
            let _ = writeln!(out, "{t:.5},{:.9},{:.9}", x[0] + self.bias + self.noise * noise(), line(t, back));
            for k in 0..FINE {
                let t = t + k as f64 * h - self.late;
                // a stage at the end of a step belongs to it: the next command is not yet there
                let at = |stage: f64| line(if self.held { t + 0.5 * h } else { stage }, back);
                let f = |x: [f64; 3], t: f64| [x[1], self.acceleration(record, x, at(t)), (x[0] - x[2]) / self.creep];
                let moved = |by: f64, d: [f64; 3]| [0, 1, 2].map(|i| x[i] + by * d[i]);
                let a = f(x, t);
                let b = f(moved(0.5 * h, a), t + 0.5 * h);
                let c = f(moved(0.5 * h, b), t + 0.5 * h);
                let d = f(moved(h, c), t + h);
                x = [0, 1, 2].map(|i| x[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
            }
        }
        out
    }

    /// Four records, the last one held out.
    pub fn logs(&self, folder: &TempDir) -> std::io::Result<()> {
        let mut noise = gaussians();
        (0..4).try_for_each(|k| std::fs::write(folder.path().join(format!("run{k}.csv")), self.run(k, &mut noise)))
    }
}

/// Standard normal numbers from a fixed seed (sums of twelve uniform ones).
fn gaussians() -> impl FnMut() -> f64 {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// The scene of the pendulum that only swings by its weight and its command; `more` goes into its experiment.
pub const SCENE: &str = r#"schema_version = 1
[time]
step = 0.00125
duration = 1.0
integrator = "midpoint"
[[body]]
name = "link"
mass = 0.5
center_of_mass = [0, 0, -0.3]
inertia = [1e-9, 1e-9, 1e-9, 0, 0, 0]
[[body.joint]]
name = "pivot"
kind = "revolute"
axis = [0, -1, 0]
[[actuator]]
name = "motor"
joint = "pivot"
kind = "torque"
[experiment]
time = { column = "t" }
[[experiment.joint]]
joint = "pivot"
column = "angle"
[[experiment.input]]
actuator = "motor"
columns = ["command"]
[[experiment.record]]
file = "run0.csv"
role = "fit"
[[experiment.record]]
file = "run1.csv"
role = "fit"
[[experiment.record]]
file = "run2.csv"
role = "fit"
[[experiment.record]]
file = "run3.csv"
role = "held_out"
"#;

/// The scene with logs of this truth.
pub fn setup(truth: &Truth, folder: &TempDir) -> Result<Setup, Box<dyn std::error::Error>> {
    truth.logs(folder)?;
    // the datum of the motor, not its torque
    let cogging = if truth.cogging == 0.0 { String::new() } else { format!("\ncogging = {{ cycles = {CYCLES} }}") };
    let joint = format!("axis = [0, -1, 0]\nstiffness = {:?}{cogging}", truth.spring);
    let text = SCENE.replace("axis = [0, -1, 0]", &joint);
    let source = Source { file: "scene.toml".to_owned(), text };
    Ok(Setup::from_source(source, folder.path().to_owned())?)
}
