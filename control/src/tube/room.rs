//! Room between opposed hard constraints, and whether a tube fits into it.

use super::Tube;
use super::constants::TUBE;
use super::error::TubeError;
use super::multipliers::Multipliers;
use super::problem::TubeProblem;
use super::rows::{RowValues, rows_of};

/// Two hard constraints of one stage that bound the same quantity from both sides, by their places among the stage's rows and inputs. The
/// two places of an input with both bounds are the same. A hard row of x₀ alone, which no input moves, has one place and the room that x₀
/// leaves.
struct Pair {
    stage: usize,
    first: usize,
    second: Option<usize>,
    /// limit of the first + limit of the second, for rows scaled to the same length.
    room: f64,
    /// Factor on the second's tightening that scales it to the first's length.
    scale: f64,
    /// No input of the stage enters.
    of_states: bool,
}

/// All pairs of a problem.
pub(super) struct Room {
    pairs: Vec<Pair>,
}

impl Pair {
    fn needed(&self, values: &[f64]) -> f64 {
        values[self.first] + self.second.map_or(0.0, |second| self.scale * values[second])
    }
}

impl Room {
    pub fn new(problem: &TubeProblem<'_>) -> Self {
        let ocp = problem.ocp;
        let mut pairs = Vec::new();
        for (stage, rows) in problem.rows.iter().enumerate() {
            let constraints = rows_of(ocp, stage);
            let hard: Vec<usize> = (0..constraints.len()).filter(|&i| constraints.weights[i] == f64::INFINITY).collect();
            for (n, &first) in hard.iter().enumerate() {
                let of_states = rows.u[first].is_empty();
                if stage == 0 && of_states {
                    let room = constraints.limits[first] - rows.apply(&ocp.x0, &vec![0.0; problem.nu])[first];
                    pairs.push(Pair { stage, first, second: None, room, scale: 1.0, of_states });
                }
                for &second in &hard[n + 1..] {
                    let both_x = opposed(&rows.x[first], &rows.x[second]);
                    let both_u = opposed(&rows.u[first], &rows.u[second]);
                    let scale = match (both_x, both_u) {
                        (Some(Ratio::Empty), Some(Ratio::Of(scale))) | (Some(Ratio::Of(scale)), Some(Ratio::Empty)) => scale,
                        (Some(Ratio::Of(x)), Some(Ratio::Of(u))) if (x - u).abs() <= TUBE.opposed * x => x,
                        _ => continue,
                    };
                    let room = constraints.limits[first] + scale * constraints.limits[second];
                    pairs.push(Pair { stage, first, second: Some(second), room, scale, of_states });
                }
            }
            if let Some(of_stage) = ocp.stages.get(stage) {
                for (i, (lower, upper)) in of_stage.lower.iter().zip(&of_stage.upper).enumerate() {
                    let place = constraints.len() + i;
                    if (upper - lower).is_finite() {
                        let room = upper - lower;
                        pairs.push(Pair { stage, first: place, second: Some(place), room, scale: 1.0, of_states: false });
                    }
                }
            }
        }
        Self { pairs }
    }

    /// Whether disturbances of a stage's own time, which no input answers before they are in its states, leave room at all.
    ///
    /// # Errors
    /// [`TubeError::Impossible`].
    pub fn check_any_policy(&self, problem: &TubeProblem<'_>) -> Result<(), TubeError> {
        let zeros = RowValues::zeros(problem.ocp);
        for pair in self.pairs.iter().filter(|pair| pair.of_states) {
            let k = pair.stage;
            let no_inputs = faer::Mat::zeros(problem.nu, problem.columns[k].ncols());
            let norms = problem.rows[k].norms(&problem.columns[k], Some(&no_inputs), &problem.balls[k]);
            let needed = pair.needed(&norms);
            if needed > pair.room {
                let constraint = zeros.constraint(k, pair.first);
                return Err(TubeError::Impossible { stage: k, constraint, needed, room: pair.room, any_policy: true });
            }
        }
        Ok(())
    }

    /// # Errors
    /// [`TubeError::Impossible`] with the pair that lacks most.
    pub fn check(&self, tightenings: &RowValues) -> Result<(), TubeError> {
        let lack = |pair: &&Pair| pair.needed(tightenings.stage(pair.stage)) - pair.room;
        match self.pairs.iter().filter(|pair| lack(pair) > 0.0).max_by(|a, b| lack(a).total_cmp(&lack(b))) {
            None => Ok(()),
            Some(pair) => Err(TubeError::Impossible {
                stage: pair.stage,
                constraint: tightenings.constraint(pair.stage, pair.first),
                needed: pair.needed(tightenings.stage(pair.stage)),
                room: pair.room,
                any_policy: false,
            }),
        }
    }

    /// Cuts tightenings to what keeps the nominal problem's interior; returns whether there were any to cut.
    pub fn cut(&self, tightenings: &mut RowValues) -> bool {
        let mut any = false;
        for pair in &self.pairs {
            let values = tightenings.stage_mut(pair.stage);
            let (needed, kept) = (pair.needed(values), TUBE.kept_room * pair.room.max(0.0));
            if needed <= kept {
                continue;
            }
            any = true;
            values[pair.first] *= kept / needed;
            if let Some(second) = pair.second.filter(|second| *second != pair.first) {
                values[second] *= kept / needed;
            }
        }
        any
    }

    /// The mean multipliers, with those of pairs that need more than their room raised, and raised ones of pairs that need less lowered.
    ///
    /// Between two opposed rows that almost touch, the nominal problem determines the difference of both multipliers, not their sum, and the
    /// sum is what the responses' weights depend on. It is found by a multiplicative ascent, μ ← μ (needed / kept)², that rests where the
    /// pair needs what is kept.
    pub fn raise(&self, tube: &Tube, multipliers: &mut Multipliers, scale: f64) -> RowValues {
        let mut weights = multipliers.mean(tube);
        for pair in self.pairs.iter().filter(|pair| pair.room > 0.0) {
            let key = (pair.stage, pair.first);
            let ratio = pair.needed(tube.tightenings.stage(pair.stage)) / (TUBE.kept_room * pair.room);
            let values = weights.stage_mut(pair.stage);
            let of_nominal = pair.second.map_or(values[pair.first], |second| values[pair.first].max(values[second]));
            if ratio <= 1.0 && !multipliers.raised.contains_key(&key) {
                continue;
            }
            // the part of the cost that a row of this width decides, where the nominal problem has no multiplier
            let start = of_nominal.max(scale / pair.room);
            let multiplier = multipliers.raised.entry(key).or_insert(start);
            *multiplier *= ratio.clamp(TUBE.escalation.recip(), TUBE.escalation).powi(2);
            for place in [Some(pair.first), pair.second].into_iter().flatten() {
                values[place] = values[place].max(*multiplier);
            }
        }
        weights
    }
}

/// How the entries of one row relate to those of its opposite.
enum Ratio {
    /// Both rows are empty.
    Empty,
    /// The first is −ratio times the second.
    Of(f64),
}

fn opposed(first: &[(usize, f64)], second: &[(usize, f64)]) -> Option<Ratio> {
    if first.len() != second.len() {
        return None;
    }
    let Some(((_, a), (_, b))) = first.first().zip(second.first()) else { return Some(Ratio::Empty) };
    let ratio = -a / b;
    let size = first.iter().fold(0.0, |size, (_, a)| f64::max(size, a.abs()));
    let all = first.iter().zip(second).all(|((i, a), (j, b))| i == j && (a + ratio * b).abs() <= TUBE.opposed * size);
    (all && ratio > 0.0).then_some(Ratio::Of(ratio))
}
