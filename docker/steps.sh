#!/bin/sh
# The steps that make the image, each by its name: for docker/Dockerfile and, without Docker, for docker/chroot.sh.
#   steps.sh requirements   hash-pinned requirements and all camera SDKs into /opt/abs-service; needs constraints-all.txt and pyproject.toml
#   steps.sh package        the program from the current folder
#   steps.sh libraries      what the SDKs need of the system: pyrealsense2 brings no libusb
#   steps.sh account        the account that runs it, and the folders that it owns
set -eu
venv=/opt/abs-service
pip="$venv/bin/python -m pip --disable-pip-version-check --no-input --no-cache-dir install --quiet --root-user-action ignore"

for step; do
  case $step in
    requirements)
      python3 -m venv $venv
      # uv takes the part of a list of pins that is asked for, and checks its hashes; pip wants the whole list.
      sed -n '/^uv==/,/[^\\]$/p' constraints-all.txt > /tmp/uv.txt
      $pip --require-hashes --only-binary :all: -r /tmp/uv.txt
      $venv/bin/uv pip install --quiet --no-cache --python $venv/bin/python --only-binary :all: \
        --constraints constraints-all.txt --requirements pyproject.toml --group build \
        --extra oak --extra kinect --extra realsense --extra ifm --extra genicam --extra import --extra mesh --extra metrics
      $venv/bin/uv pip uninstall --quiet --python $venv/bin/python uv
      ;;
    package)
      $pip --no-deps --no-build-isolation .
      ;;
    libraries)
      apt-get update -qq
      DEBIAN_FRONTEND=noninteractive apt-get install -qq -y -o Dpkg::Use-Pty=0 --no-install-recommends libusb-1.0-0 > /dev/null
      rm -rf /var/lib/apt/lists/*
      ;;
    account)
      # plugdev and video have the same numbers on every Debian and Ubuntu: with the udev rules of this folder on the
      # host, they may open cameras.
      useradd --uid 10001 --groups plugdev,video --shell /usr/sbin/nologin --home-dir /var/lib/abs-service --create-home \
        abs-service
      # Recordings, and the machine code of the kernels, compiled when the service first starts.
      install -d -o abs-service -g abs-service /var/lib/abs-service/recordings /var/cache/abs-service
      ;;
    *)
      echo "steps.sh: no step \"$step\"; there are requirements, package, libraries, account" >&2
      exit 2
      ;;
  esac
done
