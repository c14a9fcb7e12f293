# The same job on two ranks; Open MPI wants to be asked as root, and where there are fewer cores than ranks.
set -euo pipefail
cd ~/attrito
[ "$(id -u)" -ne 0 ] || set -- --allow-run-as-root
mpirun --oversubscribe "$@" -n 2 attrito run input/strip.toml --set output.file=../out/strip/two.h5 | tail -n 3
python3 - <<'END'
import attrito
import numpy as np

one, two = (attrito.Result(f"out/strip/{name}.h5") for name in ("result", "two"))
amplitudes = [result.monitor("tip", "amplitude") for result in (one, two)]
print(f"points on one rank and two: {amplitudes[0].size}, {amplitudes[1].size}")
assert np.array_equal(*amplitudes)
END
