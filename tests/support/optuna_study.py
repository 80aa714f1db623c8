"""Optuna's side of the tests in optimize_python.rs: optuna_study.py COMMAND JOURNAL [ARGUMENT...], JSON on standard output."""

import json
import sys

import optuna
from optuna.distributions import FloatDistribution
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend, JournalRedisBackend

optuna.logging.set_verbosity(optuna.logging.ERROR)

SPACE = {"f0": FloatDistribution(0.75, 1.75), "Fx": FloatDistribution(0.0, 150.0), "Fz": FloatDistribution(150.0, 350.0)}


def objective(params):
    u = [(params[n] - d.low) / (d.high - d.low) for n, d in SPACE.items()]
    return 1.0 - (u[0] - 0.35) ** 2 - (u[1] - 0.6) ** 2 - (u[2] - 0.55) ** 2


def load(path, seed=0, multivariate=True, name="forward"):
    backend = JournalRedisBackend(path) if path.startswith("redis:") else JournalFileBackend(path)
    storage = JournalStorage(backend)
    sampler = optuna.samplers.TPESampler(seed=seed, multivariate=multivariate)
    return optuna.create_study(
        storage=storage, study_name=name, direction="maximize", sampler=sampler, load_if_exists=True
    )


def summary(path):
    study = load(path)
    trials = [
        {
            "number": t.number,
            "state": t.state.name,
            "value": t.value,
            "params": t.params,
            "user_attrs": t.user_attrs,
            "fixed": t.system_attrs.get("fixed_params"),
            "seconds": t.duration.total_seconds() if t.duration else None,
        }
        for t in study.trials
    ]
    best = study.best_trial
    return {
        "best": {"number": best.number, "value": best.value, "params": best.params},
        "user_attrs": study.user_attrs,
        "metric_names": study.metric_names,
        "trials": trials,
    }


def enqueue(path, params):
    load(path).enqueue_trial(json.loads(params), user_attrs={"by": "python"})


def proceed(path, count, seed, name="forward"):
    """Runs `count` trials; answers with their numbers and parameters."""
    study = load(path, int(seed), name=name)
    done = []
    for _ in range(int(count)):
        trial = study.ask(SPACE)
        study.tell(trial, objective(trial.params))
        done.append({"number": trial.number, "params": trial.params})
    return done


def bounds(path, seed, multivariate):
    """A study in memory whose bounds change: narrower after 15 trials, back after 25, a parameter less after 32."""
    sampler = optuna.samplers.TPESampler(seed=int(seed), multivariate=multivariate == "true")
    study = optuna.create_study(direction="maximize", sampler=sampler)
    narrow = {**SPACE, "Fx": FloatDistribution(40.0, 110.0)}
    suggested = []
    for i in range(40):
        space = dict(narrow if 15 <= i < 25 else SPACE)
        if i >= 32:
            del space["f0"]
        if i == 20:
            study.enqueue_trial({"Fz": 225.0})
        trial = study.ask(space)
        suggested.append(trial.params)
        study.tell(trial, objective({"f0": 1.0, **trial.params}))
    return suggested


def importances(path):
    """PED-ANOVA's divergences, as Optuna reports them before normalization."""
    study = load(path)
    values = optuna.importance.get_param_importances(
        study, evaluator=optuna.importance.PedAnovaImportanceEvaluator(), normalize=False
    )
    return {name: float(value) for name, value in values.items()}


if __name__ == "__main__":
    command = {"summary": summary, "enqueue": enqueue, "continue": proceed, "bounds": bounds, "importances": importances}[sys.argv[1]]
    print(json.dumps(command(*sys.argv[2:])))
