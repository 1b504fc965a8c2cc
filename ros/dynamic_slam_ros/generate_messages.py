#!/usr/bin/env python3
"""Makes the headers of ROS messages. Usage: generate_messages.py OUT INCLUDE SHARE OWN

OUT/include gets a header for each message and service of the package in the folder OWN, OUT/python its module. SHARE has
the definitions of the packages that OWN uses. Debian's own headers in INCLUDE rebind allocators in a way that C++20 took
away; OUT/include, which must be looked at first, gets a copy of each of these in which that is put right.
"""

import pathlib
import re
import sys

import gencpp
import genmsg.template_tools
import genpy.generator
import genpy.genpy_main

TEMPLATES = "/usr/share/gencpp"
OLD_FOLDERS = ["ros", "roscpp", "std_msgs", "rosgraph_msgs", "geometry_msgs", "sensor_msgs", "nav_msgs", "std_srvs",
               "tf2_msgs", "diagnostic_msgs"]
OLD_REBIND = re.compile(r"ContainerAllocator::template rebind<(.*?)>::other")


def modernise(include, out):
    for folder in OLD_FOLDERS:
        for header in sorted((include / folder).glob("*.h")):
            text, count = OLD_REBIND.subn(r"std::allocator_traits<ContainerAllocator>::template rebind_alloc<\1>",
                                          header.read_text())
            if count > 0:
                # A copy has other neighbours.
                text = re.sub(r'#include "(\w+\.h)"', rf"#include <{folder}/\1>", text)
                (out / folder).mkdir(parents=True, exist_ok=True)
                (out / folder / header.name).write_text(text)


def generate(own, share, out):
    search = [f"{folder.name}:{folder / 'msg'}"
              for folder in (own, share / "std_msgs", share / "geometry_msgs", share / "nav_msgs")]
    for definition in sorted([*own.glob("msg/*.msg"), *own.glob("srv/*.srv")]):
        genmsg.template_tools.generate_from_file(
            str(definition), own.name, str(out / "include" / own.name), TEMPLATES, search,
            {"msg.h.template": "@NAME@.h"}, {"srv.h.template": "@NAME@.h"})
    module = out / "python" / own.name
    for kind, generator in (("msg", genpy.generator.MsgGenerator()), ("srv", genpy.generator.SrvGenerator())):
        (module / kind).mkdir(parents=True, exist_ok=True)
        for what in (map(str, sorted(own.glob(f"{kind}/*.{kind}"))), ["--initpy"]):
            arguments = [*(f"-I{entry}" for entry in search), "-p", own.name, "-o", str(module / kind), *what]
            try:
                genpy.genpy_main.genmain(["", *arguments], "genpy", generator)
            except SystemExit as end:
                if end.code:
                    raise
    (module / "__init__.py").touch()


def main():
    out, include, share, own = (pathlib.Path(a) for a in sys.argv[1:])
    modernise(include, out / "include")
    generate(own, share, out)


if __name__ == "__main__":
    main()
