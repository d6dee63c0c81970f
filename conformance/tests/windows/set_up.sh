#!/bin/sh
# Installs a Windows CPython under Wine, and scaraspec into it from a folder of wheels, without an
# index: set_up.sh FOLDER WHEELS. Needs wine, mvn and script. Nothing is done again if it is there.
set -eu
folder=$1 wheels=$2
export WINEPREFIX="$folder/prefix" WINEDEBUG=-all

if [ ! -e "$folder/python/ready" ]; then
  rm -rf "$folder/python" "$folder/jar" "$WINEPREFIX"
  mkdir -p "$folder/jar"
  mvn -q dependency:copy -Dmdep.useBaseVersion=true -DoutputDirectory="$folder/jar" \
    -Dartifact=org.bytedeco:cpython:3.12.1-1.5.10:jar:windows-x86_64
  python3 -m zipfile -e "$folder"/jar/*.jar "$folder/jar"
  from="$folder/jar/org/bytedeco/cpython/windows-x86_64"
  # The layout of an installation: libraries beside the interpreter, modules in Lib.
  mkdir -p "$folder/python/DLLs"
  cp "$from"/bin/python.exe "$from"/*.dll "$from"/lib/*.dll "$from"/lib/*.pyd "$folder/python"
  cp -r "$from/lib" "$folder/python/Lib"
  rm "$folder"/python/Lib/*.pyd "$folder/python/_wmi.pyd" # Wine 8 lacks what _wmi calls
  rm -r "$folder/jar"
  # A prefix without a pseudo-terminal has no console, which Python needs.
  script -qec 'wineboot --init' /dev/null >"$folder/prefix.txt" 2>&1
  script -qec 'winecfg -v win10' /dev/null >>"$folder/prefix.txt" 2>&1
  touch "$folder/python/ready"
fi

cat >"$folder/install.bat" <<BAT
@echo off
Z:$folder\\python\\python.exe -m pip install --quiet --disable-pip-version-check --no-index --find-links Z:$wheels --force-reinstall "scaraspec[pcap,serial]" > Z:$folder\\install.txt 2>&1
exit /b %errorlevel%
BAT
script -qec "wine cmd /c '$folder/install.bat'" /dev/null >/dev/null 2>&1 || { cat "$folder/install.txt" >&2; exit 1; }
