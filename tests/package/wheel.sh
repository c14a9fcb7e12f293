# The wheel finds the library of Debian's package, and h5py stays Debian's.
set -euo pipefail
cd ~
python3 -m venv --system-site-packages environment
# Without --force-reinstall pip takes the package of Debian, which it sees, for what is asked for.
environment/bin/pip install --quiet --no-deps --force-reinstall "$1"
cd attrito
../environment/bin/python - <<'END'
import attrito
import h5py
from attrito.library.loading import load

print(attrito.__file__, h5py.__file__, load()._name, sep="\n")
assert "environment" in attrito.__file__ and load()._name.startswith("/usr/lib/") and h5py.__file__.startswith("/usr/lib/")
END
../environment/bin/attrito run input/wedge.toml | tail -n 1
