//! Known answers of the evidence for a corridor.

use nalgebra::{Matrix2, Vector2};
use serde_json::Value;
use yamabico_geometry::camera::{Calibration, Mount};
use yamabico_testkit::vectors::{cases, corridor, number};
use yamabico_vision::corridor_evidence::false_alarms::{Agreement, log10_false_alarms};
use yamabico_vision::corridor_evidence::features::Features;
use yamabico_vision::corridor_evidence::foot_line::{FootLine, FootLineFinder, WallAhead};
use yamabico_vision::corridor_evidence::plumb_lines::PlumbLineFit;
use yamabico_vision::corridor_evidence::support::{self, Support};
use yamabico_vision::corridor_evidence::{
    Action, Coefficients, CorridorJudge, EvidenceTrack, Hypothesis, HypothesisSearch, Picture, RowPrior,
    SceneLines,
};
use yamabico_vision::segments::Segment;
use yamabico_vision::vanishing_point::VotingLine;

struct Case<'a> {
    id: &'a str,
    input: &'a Value,
    expect: &'a Value,
    tolerance: &'a Value,
    of_file: f64,
}

impl Case<'_> {
    fn number(&self, field: &str) -> f64 {
        number(&self.input[field])
    }

    /// Compares one number of the answer, where it is given.
    fn close(&self, field: &str, ours: f64, expected: &Value) {
        let expected = number(expected);
        let tolerance = self.tolerance.as_f64().or(self.tolerance[field].as_f64()).unwrap_or(self.of_file);
        let limit = tolerance * expected.abs().max(1.0);
        assert!((ours - expected).abs() <= limit, "{}: {field} is {ours}, not {expected}", self.id);
    }

    fn check(&self, field: &str, ours: f64) {
        self.close(field, ours, &self.expect[field]);
    }

    fn picture(&self) -> Picture {
        let or = |field: &str, default: f64| self.input[field].as_f64().unwrap_or(default);
        let center = Vector2::new(or("cx", 319.5), or("cy", 239.5));
        Picture { height: or("height", 480.0), focal: or("f", 320.0), center, scale: 1.0 }
    }

    fn segments(&self) -> Vec<Segment> {
        self.input["segments"].as_array().unwrap().iter().map(segment).collect()
    }

    fn lines(&self, roll: f64) -> SceneLines {
        let mut lines = SceneLines::default();
        lines.take(&self.segments(), &self.picture());
        lines.classify(roll);
        lines
    }
}

fn for_each_case(name: &str, check: impl Fn(&Case<'_>)) {
    let file = corridor(name);
    let of_file = &file["tolerance"];
    let of_file = of_file.as_f64().unwrap_or_else(|| of_file.as_str().unwrap().parse().unwrap());
    for case in cases(&file) {
        let (id, tolerance) = (case["id"].as_str().unwrap(), &case["tol"]);
        check(&Case { id, input: &case["input"], expect: &case["expect"], tolerance, of_file });
    }
}

fn point(value: &Value) -> Vector2<f64> {
    Vector2::new(number(&value[0]), number(&value[1]))
}

fn segment(ends: &Value) -> Segment {
    let end = |i: usize| Vector2::new(number(&ends[i]), number(&ends[i + 1]));
    Segment::between(end(0), end(2), 0.5).unwrap()
}

fn features_of(value: &Value) -> Features {
    Features {
        support_share: number(&value["shr"]),
        quadrants: number(&value["sqn"]),
        outside: number(&value["out"]),
        margin: number(&value["margin"]),
        not_by_chance: number(&value["lnfa"]),
        foot: number(&value["foot"]),
        clear_share: 0.0,
    }
}

fn coefficients(name: &str) -> Coefficients {
    let table = corridor(name)["params"]["coefficients"].clone();
    Coefficients { constant: number(&table["constant"]), features: features_of(&table) }
}

fn hypothesis(at: &Value, score: &Value) -> Hypothesis {
    Hypothesis { point: point(at), covariance: Matrix2::identity(), score: number(score) }
}

#[test]
fn nfa() {
    for_each_case("nfa", |case| {
        let ours =
            log10_false_alarms(case.number("n") as usize, case.number("k") as usize, case.number("p_mean"));
        case.check("log10_nfa", ours);
    });
}

#[test]
fn support() {
    for_each_case("support", |case| {
        let line = VotingLine::new(0, &segment(&case.input["segment"]));
        let ours = Support::of(&line, point(&case.input["point"]));
        case.check("angle_rad", ours.angle);
        case.check("sigma_rad", ours.sigma);
        case.check("kappa", ours.kappa());
        assert_eq!(Value::from(ours.straddles), case.expect["straddles"], "{}", case.id);
    });
}

#[test]
fn hypothesis_score() {
    for_each_case("hypothesis_score", |case| {
        let lines = case.lines(case.number("roll_rad"));
        let voters = lines.voters();
        let found = HypothesisSearch::default().hypothesis(voters, point(&case.input["start"])).unwrap();
        for (axis, ours) in found.point.iter().enumerate() {
            case.close("refined", *ours, &case.expect["refined"][axis]);
        }
        case.check("score", found.score);
        let mut kappas = Vec::new();
        support::kappas(voters, found.point, &mut kappas);
        case.check("spread_rad", support::spread(voters, &kappas, f64::INFINITY));
        let agreement = Agreement::count(voters, found.point, &mut Vec::new());
        case.check("log10_nfa", agreement.log10_false_alarms());
        let counts = [
            ("voters", voters.len()),
            ("verticals", lines.verticals()),
            ("horizontals", lines.horizontals()),
            ("edges_after_merging", agreement.edges),
            ("edges_aligned", agreement.aligned),
        ];
        for (field, ours) in counts {
            assert_eq!(Value::from(ours), case.expect[field], "{}: {field}", case.id);
        }
    });
}

#[test]
fn search() {
    for_each_case("search", |case| {
        let picture = case.picture();
        let prior = RowPrior {
            row: picture.center.y,
            variance: case.number("sigma_row").powi(2),
            slope: 0.0,
            is_tracked: false,
        };
        let mut judge = CorridorJudge::new(coefficients("evidence"), 0.5);
        let seen = judge.look(&case.segments(), &picture, &prior, None);
        if let Some(below) = case.expect["probability_below"].as_f64() {
            assert!(seen.probability < below, "{}: {}", case.id, seen.probability);
        }
        if case.expect["best"].is_array() {
            let best = seen.hypothesis.unwrap();
            for (axis, ours) in best.point.iter().enumerate() {
                case.close("best", *ours, &case.expect["best"][axis]);
            }
            case.check("score", best.score);
        }
        let is_none = case.expect["status"] == "none";
        assert!(!is_none || seen.hypothesis.is_none(), "{}: {seen:?}", case.id);
    });
}

#[test]
fn plumb_horizon() {
    for_each_case("plumb_horizon", |case| {
        let picture = case.picture();
        let lines = case.lines(0.0);
        let ours = PlumbLineFit::default().fit(lines.all(), &picture);
        if case.expect["status"] != "ok" {
            assert_eq!(ours, None, "{}", case.id);
            return;
        }
        let ours = ours.unwrap();
        case.check("a", ours.a);
        case.check("b", ours.b);
        case.check("roll_rad", ours.roll());
        case.check("row_at_centre", ours.row(&picture));
        for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let expected = &case.expect["covariance"][row][column];
            case.close("covariance", ours.covariance[(row, column)], expected);
        }
        assert_eq!(Value::from(ours.inliers), case.expect["inliers"], "{}", case.id);
    });
}

#[test]
fn evidence() {
    let coefficients = coefficients("evidence");
    for_each_case("evidence", |case| {
        let (picture, lines) = (case.picture(), case.lines(0.0));
        let voters = lines.voters();
        let chosen = hypothesis(&case.input["point"], &case.input["score"]);
        let others = case.input["others"].as_array().unwrap();
        let others: Vec<_> =
            others.iter().map(|other| hypothesis(&other["point"], &other["score"])).collect();
        let mut kappas = Vec::new();
        support::kappas(voters, chosen.point, &mut kappas);
        let agreement = Agreement::count(voters, chosen.point, &mut Vec::new());
        let foot = FootLineFinder::default().find(&case.segments(), &picture, chosen.point.y);
        let ours = Features::of(
            &chosen,
            others.iter(),
            voters,
            &kappas,
            agreement.log10_false_alarms(),
            foot.map_or(0.0, |foot| foot.coverage),
            &picture,
        );
        case.check("shr", ours.support_share);
        case.check("sqn", ours.quadrants);
        case.check("out", ours.outside);
        case.check("margin", ours.margin);
        case.check("lnfa", ours.not_by_chance);
        case.check("foot", ours.foot);
        case.check("probability", coefficients.probability(&ours, 0.5));
    });
}

#[test]
fn probability() {
    let coefficients = coefficients("probability");
    for_each_case("probability", |case| {
        let (features, prior) = (features_of(&case.input["features"]), case.number("prior"));
        case.check("logit", coefficients.log_odds(&features, prior));
        let probability = coefficients.probability(&features, prior);
        case.check("probability", probability);
        let action = |name: &Value| match name.as_str().unwrap() {
            "drive" => Action::Drive,
            "slow" => Action::Slow,
            "abstain" => Action::Abstain,
            other => panic!("{}: unknown action {other}", case.id),
        };
        let ours = action(&case.input["action_before"]).next(probability);
        assert_eq!(ours, action(&case.expect["action"]), "{}", case.id);
    });
}

#[test]
fn track() {
    for_each_case("track", |case| {
        let picture = case.picture();
        let calibration = match case.input["measured"].as_bool().unwrap() {
            true => Calibration::Measured,
            false => Calibration::Guessed,
        };
        let start = RowPrior::of_mount(&picture, &Mount::level(1.0), calibration, None);
        let mut track = EvidenceTrack::new(start);
        let after = case.expect["after"].as_array().unwrap();
        let steps = case.input["steps"].as_array().unwrap();
        assert_eq!(steps.len(), after.len(), "{}", case.id);
        for (step, after) in steps.iter().zip(after) {
            track.predict(number(&step["dtheta"]), number(&step["sigma_turn"]), 0.0);
            let seen = step["point"].is_array().then(|| (point(&step["point"]), number(&step["p"])));
            if let (Some((point, _)), false) = (seen, after["ln_row_prior"].is_null()) {
                let prior = track.row_prior();
                case.close(
                    "ln_row_prior",
                    prior.ln_tracked(&picture, point.y - prior.row),
                    &after["ln_row_prior"],
                );
            }
            track.update(&picture, seen);
            let (row, sigma_row) = track.row();
            case.close("row", row, &after["row"]);
            case.close("sigma_row", sigma_row, &after["sigma_row"]);
            case.close("probability", track.probability(), &after["probability"]);
            let Some((psi, sigma_psi)) = track.heading() else {
                assert!(after["psi"].is_null(), "{}: no heading", case.id);
                continue;
            };
            case.close("psi", psi, &after["psi"]);
            case.close("sigma_psi", sigma_psi, &after["sigma_psi"]);
        }
    });
}

#[test]
fn wall_ahead() {
    for_each_case("wall_ahead", |case| {
        let (picture, row) = (case.picture(), case.number("row"));
        let foot = FootLineFinder::default().find(&case.segments(), &picture, row);
        let of = |value: fn(&yamabico_vision::corridor_evidence::FootLine) -> f64| {
            foot.as_ref().map_or(0.0, value)
        };
        case.check("coverage", of(|foot| foot.coverage));
        case.check("foot_row", of(|foot| foot.row));
        case.check("u_from", of(|foot| foot.columns[0]));
        case.check("u_to", of(|foot| foot.columns[1]));
        case.check("central", of(FootLine::central_share));
        case.check("depth", foot.map_or(0.0, |foot| (foot.row - row) / picture.height));
        let wall = foot.and_then(|foot| WallAhead::of(&foot, row, &picture));
        assert_eq!(Value::from(wall.is_some()), case.expect["wall_ahead"], "{}", case.id);
        if let Some(wall) = wall {
            case.check("range_in_camera_heights", wall.range_heights);
        }
    });
}
