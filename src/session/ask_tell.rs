//! A sampler for any program: JSON lines in, JSON lines out. The program asks for points, evaluates them on its own robot,
//! simulator or function, and tells the results.
//!
//! ```text
//! {"ask":{}}                                             -> {"number":0,"params":{"f0":1.2,...},"p_stand":0.9,"predicted":0.41}
//! {"tell":{"number":0,"value":0.61,"verdict":"accept"}}  -> {"told":0,"verdict":"accept","value":0.61}
//! {"tell":{"number":1,"verdict":"fall"}}                 -> {"told":1,"verdict":"fall","value":0.0}
//! {"best":{}}                                            -> {"number":0,"params":{"f0":1.2,...},"value":0.61,"predicted":0.58}
//! anything else                                          -> {"error":"..."}
//! ```
//!
//! Every line of input has one line of output. Several points may be open before the first result is reported.

use std::collections::BTreeMap;
use std::io::{BufRead, Read as _};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::optimize::study::{Outcome, Study, StudyError, TellOutcome};
use crate::optimize::trial::{TrialState, VERDICT, json_object};
use crate::trial::Verdict;

/// Longest line, bytes, without its end.
pub const LONGEST_LINE: usize = 65_536;

const FORMS: &str = r#"give {"ask":{}}, {"best":{}} or {"tell":{"number":N,"value":J,"verdict":"accept"}} with verdict accept, fall or void"#;

/// One line of input.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
enum AskTellMessage {
    Ask(AskMessage),
    Tell(TellMessage),
    Best(BestMessage),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AskMessage {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BestMessage {}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TellMessage {
    number: u32,
    /// Objective in the task's unit; needed for `accept`, ignored otherwise.
    #[serde(default)]
    value: Option<f64>,
    verdict: Verdict,
}

/// Answer to an ask.
#[derive(Serialize)]
struct AskedPoint {
    number: u32,
    params: Value,
    /// Probability that the robot stands at the end; none for a sampler without a model.
    p_stand: Option<f64>,
    /// Mean of the objective if it stands, in the objective's unit; none for a sampler without a model.
    predicted: Option<f64>,
}

/// Answer to the question for the best trial.
#[derive(Serialize)]
struct BestPoint {
    number: u32,
    params: Value,
    /// Value that was reported.
    value: Option<f64>,
    /// Mean of the objective at this point by the sampler's model; none without a model.
    predicted: Option<f64>,
}

/// A study behind lines of JSON.
#[derive(Debug)]
pub struct AskTell {
    study: Study,
}

impl AskTell {
    /// Serves `study`.
    pub fn new(study: Study) -> AskTell {
        AskTell { study }
    }

    /// Answers one line, without its end. An error is an answer too: the study is unchanged then.
    pub fn answer(&mut self, line: &[u8]) -> String {
        // A structure could be read from a list as well.
        let is_object = serde_json::from_slice::<BTreeMap<String, BTreeMap<String, Value>>>(line).map(drop);
        let answer = match is_object.and_then(|()| serde_json::from_slice(line)) {
            Ok(AskTellMessage::Ask(AskMessage {})) => self.ask().map_err(|error| error.to_string()),
            Ok(AskTellMessage::Tell(tell)) => self.tell(&tell),
            Ok(AskTellMessage::Best(BestMessage {})) => self.best(),
            Err(error) => Err(format!("{error}; {FORMS}")),
        };
        answer.unwrap_or_else(|reason| json!({ "error": reason })).to_string()
    }

    /// Answers every line of `input` until its end. A line that is longer than [`LONGEST_LINE`] is skipped whole, with an error.
    ///
    /// # Errors
    /// When the input cannot be read.
    pub fn serve(&mut self, input: &mut impl BufRead, mut answered: impl FnMut(&str)) -> std::io::Result<()> {
        let mut line = Vec::new();
        loop {
            line.clear();
            if input.by_ref().take(LONGEST_LINE as u64 + 1).read_until(b'\n', &mut line)? == 0 {
                return Ok(());
            }
            if line.last() != Some(&b'\n') && line.len() > LONGEST_LINE {
                skip_line(input)?;
                let reason = format!("the line has more than {LONGEST_LINE} bytes; {FORMS}");
                answered(&json!({ "error": reason }).to_string());
                continue;
            }
            answered(&self.answer(line.trim_ascii_end()));
        }
    }

    fn ask(&mut self) -> Result<Value, StudyError> {
        let draft = self.study.draft();
        let number = self.study.begin(&draft, &[], &[])?;
        let point = AskedPoint {
            number,
            params: draft.parameters.iter().map(|p| (p.name.clone(), Value::from(p.value))).collect(),
            p_stand: draft.expected.map(|expected| expected.p_stand),
            predicted: draft.expected.map(|expected| expected.value),
        };
        Ok(json!(point))
    }

    /// The best trial by the sampler's model; without a model by value.
    fn best(&self) -> Result<Value, String> {
        let model = self.study.predict().best;
        let number = model.map(|best| best.trial).or_else(|| self.study.best().map(|best| best.number));
        let number = number.ok_or("no trial has stood yet")?;
        let trial = self.study.trial(number).map_err(|error| error.to_string())?;
        Ok(json!(BestPoint {
            number,
            params: json_object(&trial.parameters),
            value: trial.value,
            predicted: model.map(|best| best.predicted),
        }))
    }

    fn tell(&mut self, tell: &TellMessage) -> Result<Value, String> {
        let TellMessage { number, value, verdict } = *tell;
        let state = self.study.trial(number).map_err(|error| error.to_string())?.state;
        match state {
            TrialState::Running => {}
            TrialState::Waiting => return Err(format!("trial {number} is queued; ask for it first")),
            _ => return Err(format!("trial {number} was told before; ask for another point")),
        }
        let (outcome, value) = match (verdict, value) {
            (Verdict::Accept, None) => {
                return Err(format!("trial {number}: the verdict accept needs a value, the objective of the trial"));
            }
            (Verdict::Accept, Some(value)) => (Outcome::Complete(value), Some(value)),
            (Verdict::Fall, _) => (Outcome::Complete(0.0), Some(0.0)),
            (Verdict::Void, _) => (Outcome::Fail, None),
        };
        let attributes = [(VERDICT.to_owned(), verdict.name().into())];
        match self.study.tell_if(number, outcome, &attributes, &|_| true) {
            Ok(TellOutcome::Recorded) => Ok(json!({ "told": number, "verdict": verdict.name(), "value": value })),
            Ok(TellOutcome::AlreadyFinished) => Err(format!("trial {number} was finished by another program")),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// Reads to the end of the line, in parts.
fn skip_line(input: &mut impl BufRead) -> std::io::Result<()> {
    let mut part = Vec::new();
    loop {
        part.clear();
        let read = input.by_ref().take(LONGEST_LINE as u64).read_until(b'\n', &mut part)?;
        if read == 0 || part.last() == Some(&b'\n') {
            return Ok(());
        }
    }
}
