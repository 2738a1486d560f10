#!/usr/bin/env bash
# Takes out of the base what no program of ours runs, by Debian's own records, so that scanners and the
# bill of materials see what is there. Package managers, Perl and logins go; a shell, the core
# utilities and certificates stay, for health checks and for people who look into a container.
set -euo pipefail
gone=(
    adduser apt bsdutils debconf debian-archive-keyring diffutils e2fsprogs gpgv init-system-helpers libapt-pkg6.0
    libblkid1 libdb5.3 libext2fs2 libgcrypt20 libgnutls30 libgpg-error0 libgssapi-krb5-2 libhogweed6 libidn2-0
    libk5crypto3 libkeyutils1 libkrb5-3 libkrb5support0 liblz4-1 libmount1 libnettle8 libnsl2 libp11-kit0 libpam-modules
    libpam-modules-bin libpam-runtime libpam0g libseccomp2 libsemanage-common libsemanage2 libsepol2 libsmartcols1
    libss2 libsystemd0 libtasn1-6 libtirpc-common libtirpc3 libudev1 libunistring2 libxxhash0 login logsave mount
    netbase openssl passwd perl-base python3-distutils python3-lib2to3 python3-pip-whl python3-setuptools-whl
    python3-venv python3.11-venv sysvinit-utils usr-is-merged util-linux util-linux-extra
)
groupadd --gid 10001 buildarena
useradd --uid 10001 --gid 10001 --home-dir /tmp --no-create-home --shell /usr/sbin/nologin buildarena
mapfile -t installed < <(dpkg-query --show --showformat '${db:Status-Abbrev} ${Package}\n' "${gone[@]}" 2>/dev/null |
    sed -n 's/^ii *//p')
for package in "${installed[@]}"; do
    rm -f /var/lib/dpkg/info/"$package".{prerm,postrm} /var/lib/dpkg/info/"$package":*.{prerm,postrm}
done
dpkg --purge --force-all "${installed[@]}" >/dev/null 2>&1
# Conversions between character sets, which Python does itself; and what came with the interpreter.
rm -rf /usr/lib/*/gconv /usr/share/{man,info,locale,lintian,perl5,python-wheels} /var/cache/* /var/lib/apt /var/log/* \
    /usr/lib/python3*/{ensurepip,idlelib,lib2to3,pydoc_data,test,turtledemo} \
    /usr/local/lib/python3*/{ensurepip,idlelib,lib2to3,pydoc_data,test,turtledemo} \
    /usr/local/lib/python3*/site-packages/* /usr/local/bin/pip* /usr/bin/{dpkg*,localedef}
# What is loaded of it is compiled again, by imports.py.
find /usr/lib /usr/local/lib -name __pycache__ -prune -exec rm -rf {} +
find /usr/share/doc -type f ! -name copyright -delete
install -d -o 10001 -g 10001 /artifacts /backups
install -d -m 1777 /tmp
