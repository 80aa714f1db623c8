//! Fields of proposals, trials and the state of the optimizer, for both directions.

use super::frog;
use super::wire::{DecodeError, Way};
use crate::trial::{
    Displacement, DrawnRange, ExpectedResult, FallRisk, FixedParameter, JumpRow, MeasuredJump, ParameterInsight,
    PointRecord, PredictedTrial, Proposal, ProposalInsight, ProposedParameter, QueuedPoint, RepeatRecord, SearchStatus,
    SearchedParameter, SimulatorComparison, TrialRecord, WorldResemblance,
};

type Done = Result<(), DecodeError>;

pub fn proposal(way: Way, ours: &mut Proposal, m: &mut frog::Proposal) -> Done {
    way.copy(&mut ours.trial, &mut m.trial);
    way.copy(&mut ours.revision, &mut m.revision);
    way.variant(&mut ours.source, &mut m.source, "source")?;
    way.copy(&mut ours.parent, &mut m.parent);
    way.list(&mut ours.parameters, &mut m.parameters, proposed)?;
    way.option(&mut ours.risk, &mut m.risk, risk)?;
    way.list(&mut ours.gains, &mut m.gains, proposed)?;
    way.copy(&mut ours.repeat, &mut m.repeat);
    way.copy(&mut ours.repeats, &mut m.repeats);
    way.option(&mut ours.expected, &mut m.expected, expected)
}

fn proposed(way: Way, ours: &mut ProposedParameter, m: &mut frog::proposal::Parameter) -> Done {
    way.copy(&mut ours.name, &mut m.name);
    way.number(&mut ours.value, &mut m.value);
    way.number(&mut ours.proposed, &mut m.proposed);
    Ok(())
}

pub fn trial(way: Way, ours: &mut TrialRecord, m: &mut frog::Trial) -> Done {
    way.copy(&mut ours.trial, &mut m.trial);
    way.variant(&mut ours.source, &mut m.source, "source")?;
    way.copy(&mut ours.parent, &mut m.parent);
    way.values(&mut ours.parameters, &mut m.parameters);
    way.option(&mut ours.measured, &mut m.measured, measured)?;
    way.copy(&mut ours.value, &mut m.value);
    way.copy(&mut ours.hand_value, &mut m.hand_value);
    way.maybe_variant(&mut ours.suggested, &mut m.suggested, "verdict")?;
    way.copy(&mut ours.cause, &mut m.cause);
    way.maybe_variant(&mut ours.verdict, &mut m.verdict, "verdict")?;
    way.copy(&mut ours.note, &mut m.note);
    way.option(&mut ours.risk, &mut m.risk, risk)?;
    way.values(&mut ours.gains, &mut m.gains);
    way.list(&mut ours.repeats, &mut m.repeats, repeat)?;
    way.copy(&mut ours.seed, &mut m.seed);
    way.list(&mut ours.ranges, &mut m.ranges, drawn_range)?;
    way.option(&mut ours.expected, &mut m.expected, expected)?;
    way.maybe_variant(&mut ours.judged_by, &mut m.judged_by, "origin of a verdict")?;
    way.values(&mut ours.proposed, &mut m.proposed);
    Ok(())
}

fn drawn_range(way: Way, ours: &mut DrawnRange, m: &mut frog::trial::Range) -> Done {
    way.copy(&mut ours.name, &mut m.name);
    way.number(&mut ours.low, &mut m.low);
    way.number(&mut ours.high, &mut m.high);
    Ok(())
}

fn repeat(way: Way, ours: &mut RepeatRecord, m: &mut frog::trial::Repeat) -> Done {
    way.copy(&mut ours.seed, &mut m.seed);
    way.maybe_variant(&mut ours.verdict, &mut m.verdict, "verdict")?;
    way.copy(&mut ours.value, &mut m.value);
    way.copy(&mut ours.cause, &mut m.cause);
    way.option(&mut ours.measured, &mut m.measured, measured)?;
    way.maybe_variant(&mut ours.judged_by, &mut m.judged_by, "origin of a verdict")
}

fn measured(way: Way, ours: &mut MeasuredJump, m: &mut frog::trial::Measured) -> Done {
    way.number(&mut ours.dx_m, &mut m.dx);
    way.number(&mut ours.dy_m, &mut m.dy);
    way.number(&mut ours.dyaw_rad, &mut m.dyaw);
    way.number(&mut ours.apex_m, &mut m.apex);
    way.number(&mut ours.air_s, &mut m.air);
    way.copy(&mut ours.measured_value, &mut m.value);
    way.number(&mut ours.end_s, &mut m.end);
    way.copy(&mut ours.flights, &mut m.flights);
    way.option(&mut ours.touchdown, &mut m.touchdown, displacement)?;
    way.option(&mut ours.first_landing, &mut m.first_landing, displacement)?;
    way.list(&mut ours.jumps, &mut m.jumps, jump)
}

fn displacement(way: Way, ours: &mut Displacement, m: &mut frog::trial::Displacement) -> Done {
    way.number(&mut ours.time_s, &mut m.time);
    way.number(&mut ours.dx_m, &mut m.dx);
    way.number(&mut ours.dy_m, &mut m.dy);
    way.number(&mut ours.dyaw_rad, &mut m.dyaw);
    Ok(())
}

fn jump(way: Way, ours: &mut JumpRow, m: &mut frog::trial::Jump) -> Done {
    way.number(&mut ours.time_s, &mut m.time);
    way.number(&mut ours.x_m, &mut m.x);
    way.number(&mut ours.y_m, &mut m.y);
    way.number(&mut ours.yaw_rad, &mut m.yaw);
    way.number(&mut ours.tilt_rad, &mut m.tilt);
    way.number(&mut ours.rise_m, &mut m.rise);
    way.number(&mut ours.air_s, &mut m.air);
    way.number(&mut ours.value, &mut m.value);
    Ok(())
}

fn risk(way: Way, ours: &mut FallRisk, m: &mut frog::Risk) -> Done {
    way.copy(&mut ours.nearest_fall, &mut m.nearest_fall);
    way.copy(&mut ours.nearest_fall_trial, &mut m.nearest_fall_trial);
    way.copy(&mut ours.falls, &mut m.falls);
    way.copy(&mut ours.neighbours, &mut m.neighbours);
    Ok(())
}

fn expected(way: Way, ours: &mut ExpectedResult, m: &mut frog::Expected) -> Done {
    way.number(&mut ours.value, &mut m.value);
    way.number(&mut ours.deviation, &mut m.deviation);
    way.number(&mut ours.p_stand, &mut m.p_stand);
    way.copy(&mut ours.simulated_least, &mut m.simulated_least);
    way.copy(&mut ours.simulated_most, &mut m.simulated_most);
    way.copy(&mut ours.advises_to_stop, &mut m.advises_to_stop);
    Ok(())
}

pub fn search(way: Way, ours: &mut SearchStatus, m: &mut frog::Search) -> Done {
    way.copy(&mut ours.budget, &mut m.budget);
    way.copy(&mut ours.counted, &mut m.counted);
    way.list(&mut ours.parameters, &mut m.parameters, searched)?;
    way.copy(&mut ours.hop_share, &mut m.hop_share);
    way.copy(&mut ours.confirming, &mut m.confirming);
    way.list(&mut ours.queue, &mut m.queue, queued)
}

fn queued(way: Way, ours: &mut QueuedPoint, m: &mut frog::search::Queued) -> Done {
    way.copy(&mut ours.trial, &mut m.trial);
    way.variant(&mut ours.source, &mut m.source, "source")?;
    way.copy(&mut ours.parent, &mut m.parent);
    way.values(&mut ours.parameters, &mut m.parameters);
    way.values(&mut ours.gains, &mut m.gains);
    Ok(())
}

fn searched(way: Way, ours: &mut SearchedParameter, m: &mut frog::search::Parameter) -> Done {
    way.copy(&mut ours.name, &mut m.name);
    way.number(&mut ours.low, &mut m.low);
    way.number(&mut ours.high, &mut m.high);
    way.number(&mut ours.least, &mut m.least);
    way.number(&mut ours.most, &mut m.most);
    way.option(&mut ours.fixed, &mut m.fixed, fixed)
}

fn fixed(way: Way, ours: &mut FixedParameter, m: &mut frog::search::Fixed) -> Done {
    way.number(&mut ours.value, &mut m.value);
    way.copy(&mut ours.trials, &mut m.trials);
    Ok(())
}

pub fn insight(way: Way, ours: &mut ProposalInsight, m: &mut frog::Insight) -> Done {
    way.copy(&mut ours.trial, &mut m.trial);
    way.list(&mut ours.parameters, &mut m.parameters, reasons)?;
    way.list(&mut ours.predicted, &mut m.predicted, predicted)?;
    way.copy(&mut ours.best, &mut m.best);
    way.option(&mut ours.simulator, &mut m.simulator, simulator)
}

fn predicted(way: Way, ours: &mut PredictedTrial, m: &mut frog::insight::Predicted) -> Done {
    way.copy(&mut ours.trial, &mut m.trial);
    way.number(&mut ours.value, &mut m.value);
    way.number(&mut ours.deviation, &mut m.deviation);
    Ok(())
}

fn simulator(way: Way, ours: &mut SimulatorComparison, m: &mut frog::insight::Simulator) -> Done {
    way.number(&mut ours.ratio, &mut m.ratio);
    way.number(&mut ours.ratio_deviation, &mut m.ratio_deviation);
    way.number(&mut ours.bias, &mut m.bias);
    way.number(&mut ours.bias_deviation, &mut m.bias_deviation);
    way.copy(&mut ours.contradicted, &mut m.contradicted);
    way.list(&mut ours.worlds, &mut m.worlds, world)
}

fn world(way: Way, ours: &mut WorldResemblance, m: &mut frog::insight::World) -> Done {
    way.copy(&mut ours.name, &mut m.name);
    way.number(&mut ours.weight, &mut m.weight);
    Ok(())
}

fn reasons(way: Way, ours: &mut ParameterInsight, m: &mut frog::insight::Parameter) -> Done {
    way.copy(&mut ours.name, &mut m.name);
    way.number(&mut ours.proposed, &mut m.proposed);
    way.copy(&mut ours.importance, &mut m.importance);
    way.copy(&mut ours.at, &mut m.at);
    way.copy(&mut ours.good, &mut m.good);
    way.copy(&mut ours.bad, &mut m.bad);
    Ok(())
}

pub fn points(way: Way, ours: &mut Vec<PointRecord>, m: &mut frog::Points) -> Done {
    way.list(ours, &mut m.points, point)
}

fn point(way: Way, ours: &mut PointRecord, m: &mut frog::points::Point) -> Done {
    way.values(&mut ours.parameters, &mut m.parameters);
    way.copy(&mut ours.trials, &mut m.trials);
    way.copy(&mut ours.without_fall, &mut m.stood);
    way.number(&mut ours.mean, &mut m.mean);
    way.copy(&mut ours.deviation, &mut m.deviation);
    way.copy(&mut ours.contender, &mut m.contender);
    way.copy(&mut ours.confidence, &mut m.confidence);
    Ok(())
}
