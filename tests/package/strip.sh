# The strip of docs/tutorials/first-run.md, from the deck to the pictures.
set -euo pipefail
cd ~
attrito --version
cp -r /usr/share/doc/attrito/examples attrito
cd attrito
mkdir -p out/strip
cp input/strip.inp out/strip
(cd out/strip && ccx strip > ccx.log)
attrito import out/strip/model.h5 --calculix out/strip/strip --mesh out/strip/strip.inp
attrito run input/strip.toml
attrito plot out/strip/result.h5
attrito report out/strip/result.h5
attrito table out/strip/result.h5 | tail -n 2
[ "$(head -c 4 out/strip/frf.png | tail -c 3)" = PNG ]
grep -q 'Every point has a solution' out/strip/report.html
