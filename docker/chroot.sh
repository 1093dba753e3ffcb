#!/bin/bash
# Takes the steps of docker/Dockerfile without Docker, on a base made by debootstrap, and tries what comes out: every SDK
# is imported, and a simulated rig runs, is asked for its status and has a subscriber, all without root.
#   docker/chroot.sh FOLDER    as root, on Linux with debootstrap; FOLDER is made, takes 3 GB, and is not removed
# Exits with 3 if no base could be made.
# The base differs from the image's in where Python comes from: here it is Debian's, whose shared library, which genicam
# asks for, is a package of its own; in python:slim it is its own build, with the library.
set -euo pipefail
root=$(realpath -m "${1:?usage: docker/chroot.sh FOLDER}")
cd "$(dirname "$0")/.."
[ "$(id -u)" = 0 ] || { echo "chroot.sh: has to run as root" >&2; exit 2; }

# Nothing that is mounted or started in there outlives the command.
inside() {
  unshare --mount --pid --fork --kill-child -- bash -euc '
    mount -t proc proc "$0/proc" && mount -t tmpfs tmpfs "$0/dev/shm"
    exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root SSL_CERT_FILE=/etc/ssl/certs/ca-certificates.crt ${https_proxy:+https_proxy="$https_proxy"} \
      chroot "$0" /bin/bash -euc "$1"' "$root" "$1"
}

if [ ! -e "$root/etc/debian_version" ]; then
  debootstrap --variant=minbase --include=python3,libpython3.13,python3-venv,ca-certificates trixie "$root" > "$root.log" ||
    { echo "chroot.sh: debootstrap made no base, see $root.log" >&2; exit 3; }
fi
mkdir -p "$root/src" "$root/dev/shm"
tar -c --exclude=__pycache__ abs_service calib drivers proto docker/steps.sh examples/subscribe.py pyproject.toml \
  constraints-all.txt README.md LICENSE | tar -x -C "$root/src"
# Names and certificates as this machine has them, or pip finds no packages.
cp -L /etc/resolv.conf "$root/etc/resolv.conf"
cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"

inside 'cd /src && docker/steps.sh requirements package libraries && { id abs-service > /dev/null 2>&1 || docker/steps.sh account; }'

echo "== sizes"
du -shx --exclude=opt --exclude=src --exclude=var/cache --exclude=var/lib/abs-service "$root" | sed "s#$root#the base#"
du -sh "$root/opt/abs-service" | sed "s#$root##"
(cd "$root"/opt/abs-service/lib/python3*/site-packages && du -shc depthai* genicam* harvesters* ifm3dpy* pyrealsense2* libusb_package* pyusb* usb av av.libs* rosbags* |
  sed 's/total/all of the SDKs and readers/')

echo "== as abs-service, without root"
inside 'exec su abs-service -s /bin/bash -c "
  set -eu
  export PATH=/opt/abs-service/bin:\$PATH NUMBA_CACHE_DIR=/var/cache/abs-service MPLCONFIGDIR=/tmp
  cd /var/lib/abs-service
  id
  python -c \"import av, depthai, harvesters.core, ifm3dpy, libusb_package, prometheus_client, pyrealsense2, rosbags, trimesh, usb; print(\\\"every SDK is imported\\\")\"
  abs-service devices || true
  abs-service run --duration 90 > run.log 2>&1 & service=\$!
  for second in {1..60}; do abs-service status > /dev/null 2>&1 && break; done
  timeout 60 python /src/examples/subscribe.py --count 3
  abs-service status
  kill -TERM \$service
  wait \$service
  tail -n 4 run.log
"'
