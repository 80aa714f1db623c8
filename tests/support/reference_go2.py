#!/usr/bin/env python3
"""Reference jumps of the Go2 in MuJoCo, the paper's controller without added terms; writes tests/golden/jumps_go2.json.

    pip install mujoco numpy
    python3 tests/support/reference_go2.py tests/golden/jumps_go2.json --seed 20261123 --cases 24

Protocol: that of tests/support/reference_landing.py. Bodies come from robots/go2/go2.urdf, stance and bounds from robots/go2/config.
"""

import reference_landing as reference

reference.__doc__ = __doc__
reference.URDF = reference.URDF.parents[2] / "robots/go2/go2.urdf"
reference.ABDUCTION, reference.FOOT_RADIUS = 0.0955, 0.022
reference.STANCE = reference.np.array([0.0, 0.1555, -0.25])
reference.BOUNDS = dict(f0_hz=(0.75, 1.75), along_n=(0, 180), up_n=(180, 400))
reference.TERMS = reference.PAPER

if __name__ == "__main__":
    reference.main()
