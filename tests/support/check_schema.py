"""Checks TOML files against the JSON schemas of a folder; prints the refusals of each file as one JSON object.

check_schema.py FOLDER: every TOML file of FOLDER against the schema of its name in FOLDER/schemas.
"""

import json
import sys
import tomllib
from pathlib import Path

try:
    from jsonschema import Draft202012Validator
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit(77)

folder = Path(sys.argv[1])
refusals = {}
for file in sorted(folder.rglob("*.toml")):
    schema = json.loads((folder / "schemas" / f"{file.stem}.schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    errors = Draft202012Validator(schema).iter_errors(tomllib.loads(file.read_text()))
    refusals[str(file.relative_to(folder))] = sorted(error.json_path + ": " + error.message for error in errors)
print(json.dumps(refusals))
