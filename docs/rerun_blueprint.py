"""Writes a rerun blueprint for recordings of quadfrog: python3 rerun_blueprint.py [FILE.rbl], default quadfrog.rbl.

Needs `pip install rerun-sdk`, the only writer of blueprints. A blueprint belongs to recordings of its application id:

    rerun mcap convert session.mcap --application-id quadfrog -o session.rrd
    rerun session.rrd quadfrog.rbl
"""

import sys

import rerun.blueprint as rrb

blueprint = rrb.Blueprint(
    rrb.Horizontal(
        rrb.Vertical(
            rrb.Spatial3DView(
                name="Robot", origin="/", contents=["/tf", "/scene/robot", "/scene/ground", "/robot/pose"]
            ),
            rrb.TextLogView(name="Log", contents=["/log"]),
            row_shares=[3, 1],
        ),
        rrb.Vertical(
            rrb.DataframeView(name="State of a tick", contents=["/robot/tick"]),
            rrb.DataframeView(name="Command", contents=["/robot/joint_cmd"]),
            rrb.DataframeView(name="Changes of mode", contents=["/fsm"]),
        ),
        column_shares=[3, 2],
    ),
    rrb.TimePanel(state="expanded"),
)
path = sys.argv[1] if len(sys.argv) > 1 else "quadfrog.rbl"
blueprint.save("quadfrog", path)
print(path)
