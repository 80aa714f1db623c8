"""Optuna's side of tests/console/optuna_versions.rs, for Optuna 4 and 5: optuna_versions.py COMMAND [ARGUMENT...]."""

import json
import sys
import warnings

import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend

optuna.logging.set_verbosity(optuna.logging.ERROR)
warnings.simplefilter("ignore")


def storage(path):
    return JournalStorage(JournalFileBackend(path))


def own(path):
    return optuna.load_study(study_name=optuna.get_all_study_names(storage(path))[0], storage=storage(path))


def create(path, direction):
    """A study of six trials with all kinds of parameters; two values of an attribute are missing, one trial is pruned."""
    sampler = optuna.samplers.RandomSampler(seed=1)
    study = optuna.create_study(storage=storage(path), study_name="theirs", direction=direction, sampler=sampler)
    if direction == "maximize":
        study.set_metric_names(["height (m)"])

    def objective(trial):
        x = trial.suggest_float("x", -5, 5)
        gain = trial.suggest_float("gain", 1e-3, 1, log=True)
        steps = trial.suggest_int("steps", 1, 10)
        kind = trial.suggest_categorical("kind", ["soft", "hard", "7"])
        if trial.number == 2:
            raise optuna.TrialPruned()
        if trial.number > 3:
            trial.set_user_attr("seed", "16294208416658607535")
        trial.set_user_attr("cause", f"landed, {kind}")
        trial.set_user_attr("terms", {"a": x, "b": [1, None]})
        trial.set_user_attr("stood", trial.number % 2 == 0)
        return (x - 1) ** 2 + steps + gain

    study.optimize(objective, n_trials=6)
    study.enqueue_trial({"x": 0.5})


def floats(path):
    """A minimized study of five trials with two float parameters; the first is neither the best nor the worst."""
    sampler = optuna.samplers.RandomSampler(seed=4)
    study = optuna.create_study(storage=storage(path), study_name="floats", direction="minimize", sampler=sampler)
    study.optimize(lambda t: (t.suggest_float("x", -5, 5) - 1) ** 2 + t.suggest_float("y", 0, 1), n_trials=5)


def choices(path):
    study = optuna.create_study(storage=storage(path), study_name="choices")
    study.optimize(lambda t: len(t.suggest_categorical("kind", ["a", "bb"])), n_trials=2)


def sqlite(path):
    study = optuna.create_study(storage=f"sqlite:///{path}", study_name="in-sqlite", direction="maximize")
    study.optimize(lambda t: t.suggest_float("x", 0, 1), n_trials=3)


def more(path, count):
    """Further trials of the only study."""
    study = own(path)
    ranges = next(t.distributions for t in study.trials if t.distributions)
    for _ in range(int(count)):
        trial = study.ask(dict(ranges))
        study.tell(trial, 0.25)


def times(path):
    """Start, end, value and state of each trial; whether the timeline can be drawn."""
    study = own(path)
    try:
        optuna.visualization.plot_timeline(study)
        timeline = True
    except TypeError:
        timeline = False
    utc = lambda at: at and round(at.timestamp() * 1e6)
    trials = [[utc(t.datetime_start), utc(t.datetime_complete), t.value, t.state.name] for t in study.trials]
    print(json.dumps({"version": optuna.__version__, "timeline": timeline, "trials": trials}))


def compare(path, csv, jsn, parquet):
    """Fails unless the three tables equal trials_dataframe."""
    import pandas as pd

    theirs = own(path).trials_dataframe()
    # A queued trial has its parameters among the system attributes; a table of this program names them.
    waiting = theirs["state"] == "WAITING"
    for name, table in [
        ("csv", pd.read_csv(csv, dtype={"user_attrs_seed": str})),
        ("json", pd.DataFrame(json.load(open(jsn)))),
        ("parquet", pd.read_parquet(parquet)),
    ]:
        assert list(table.columns) == [*theirs.columns, "note"], (name, list(table.columns), list(theirs.columns))
        assert len(table) == len(theirs), name
        for column in theirs.columns:
            rows = ~waiting if column.startswith("params_") else waiting | True
            ours, own_cells = table[column][rows], theirs[column][rows]
            if column.startswith("datetime"):
                ours = pd.to_datetime(ours, utc=True)
                own_cells = pd.to_datetime(
                    [at if at is pd.NaT or at.tzinfo else at.to_pydatetime().astimezone() for at in own_cells], utc=True
                )
            elif column == "duration":
                ours = pd.to_timedelta(ours)
            for a, b in zip(ours, own_cells):
                if isinstance(b, (dict, list)):
                    a = json.loads(a) if isinstance(a, str) else a
                if b is None or b is pd.NaT or b != b:
                    assert a is None or a is pd.NaT or a != a, (name, column, a, b)
                else:
                    assert str(a) == b if isinstance(b, str) else a == b, (name, column, a, b)
    print(json.dumps({"version": optuna.__version__, "columns": list(theirs.columns)}))


if __name__ == "__main__":
    commands = [create, floats, choices, sqlite, more, times, compare]
    {command.__name__: command for command in commands}[sys.argv[1]](*sys.argv[2:])
