#!/usr/bin/env bash
# A package of Debian and a wheel of attrito, tried on a bare Debian 12 (script/package --try): bare.sh attrito_*.deb attrito-*.whl
# As root. Installed there are the package with its dependencies alone, CalculiX for the strip of docs/tutorials/first-run.md, and a shell's completion.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
package=$(realpath "$1") wheel=$(realpath "$2")
lintian --fail-on error --suppress-tags initial-upload-closes-no-bugs --allow-root "$package"

# The mirror that this machine's apt has of Debian 12
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Codename: bookworm' 'Created-By: Packages' | head -n 1)
place=$(mktemp -d /tmp/attrito-bare.XXXXXX)
leave() {
  for mount in sys dev/shm proc; do ! mountpoint -q "$place/$mount" || umount "$place/$mount"; done
  rm -rf --one-file-system "$place"
}
trap leave EXIT
chmod 755 "$place"
debootstrap --variant=minbase bookworm "$place" "$mirror" > "$place.log" || { tail -n 20 "$place.log" >&2; exit 1; }
rm "$place.log"
cp /etc/resolv.conf "$place/etc"
mount -t proc proc "$place/proc"
mkdir -p "$place/dev/shm"
mount -t tmpfs tmpfs "$place/dev/shm"
mount -t sysfs -o ro sysfs "$place/sys"

within() { chroot "$place" env -i DEBIAN_FRONTEND=noninteractive LANG=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"; }
within useradd --create-home --shell /bin/bash someone
cp "$here"/{strip,ranks,wheel}.sh "$package" "$wheel" "$place/tmp"
within apt-get update -qq
within apt-get install -y -qq --no-install-recommends "/tmp/$(basename "$package")" calculix-ccx > "$place/tmp/apt.log" 2>&1 ||
  { tail -n 20 "$place/tmp/apt.log" >&2; exit 1; }

for user in root someone; do
  printf '== %s: the strip, then on two ranks\n' "$user"
  within su - "$user" -c 'bash /tmp/strip.sh && bash /tmp/ranks.sh'
done
echo '== a wheel in an environment that sees the packages of Debian'
within apt-get install -y -qq --no-install-recommends python3-venv > /dev/null 2>&1
within su - someone -c "bash /tmp/wheel.sh /tmp/$(basename "$wheel")"
echo '== what is left when it is removed'
within apt-get purge -y -qq attrito > /dev/null 2>&1
left=$(within sh -c 'find / -xdev -path "*attrito*" -not -path "/tmp/*" -not -path "/home/*" -not -path "/root/*" -not -path "/proc/*" -not -path "/var/log/*"')
[ -z "$left" ] || { echo "$left"; exit 1; }
echo 'all passed'
