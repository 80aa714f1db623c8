//! Tables of trials from other programs.

use quadfrog::optimize::exchange::from_csv;
use serde_json::json;

/// Regression: lists and dictionaries, which Python prints in its own syntax, became texts, and an import lost them without a word.
#[test]
fn cells_as_python_prints_them_have_their_values() {
    let columns = ["gains", "jumps", "touchdown", "risk", "odd", "rerun", "cause", "note"];
    let cells = [
        "{'k_att': 200.0, 'kd_joint': 1e-05}",
        "[{'air_s': 0.541, 'turn_rad': -0.02}, {}]",
        "{'stood': True, 'fell': False}",
        "{'falls': 0, 'nearest_fall': None, 'seeds': [16294208416658607535]}",
        r#"{"it's": 'a "quote" \\ \n \xe9 \u0416'}"#,
        "False",
        "[looked well] and 'stood'",
        "{'landed'}",
    ];
    let quoted = |cell: &&str| format!("\"{}\"", cell.replace('"', "\"\""));
    let header = columns.map(|name| format!("user_attrs_{name}")).join(",");
    let row = cells.iter().map(quoted).collect::<Vec<_>>().join(",");
    let table = format!("params_f0,value,{header}\n1.2,0.5,{row}\n");
    let trials = from_csv(&table).unwrap();
    let expected = json!({
        "gains": { "k_att": 200.0, "kd_joint": 1e-5 },
        "jumps": [{ "air_s": 0.541, "turn_rad": -0.02 }, {}],
        "touchdown": { "stood": true, "fell": false },
        "risk": { "falls": 0, "nearest_fall": null, "seeds": [16_294_208_416_658_607_535_u64] },
        "odd": { "it's": "a \"quote\" \\ \n \u{e9} \u{416}" },
        "rerun": false,
        "cause": "[looked well] and 'stood'",
        "note": "{'landed'}",
    });
    assert_eq!(json!(trials[0].attributes), expected);
}
