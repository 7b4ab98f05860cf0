"""Writes what `cargo metadata` tells (standard input, of one workspace after the other) as a bill of materials: CycloneDX 1.5, JSON.

Components are what is linked into some program, or builds it: what only tests need is left out.
"""

import json
import sys


def reached(nodes, roots):
    """Ids of packages that `roots` need, by normal and build dependencies."""
    found, left = set(), list(roots)
    while left:
        node = left.pop()
        if node in found:
            continue
        found.add(node)
        for dependency in nodes[node]["deps"]:
            if any(kind["kind"] != "dev" for kind in dependency["dep_kinds"]):
                left.append(dependency["pkg"])
    return found


def purl(package):
    return f"pkg:cargo/{package['name']}@{package['version']}"


def component(package, is_program):
    told = {
        "type": "application" if is_program else "library",
        # Not cargo's own id, which has paths of this machine.
        "bom-ref": purl(package),
        "name": package["name"],
        "version": package["version"],
        "purl": purl(package),
    }
    if package.get("license"):
        # Before there was SPDX for it, people wrote a slash.
        told["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    if package.get("repository"):
        told["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
    return told


def main(path):
    workspaces = [json.loads(line) for line in sys.stdin]
    packages = {package["id"]: package for metadata in workspaces for package in metadata["packages"]}
    # What is in both may need more in one of them.
    nodes = {}
    for metadata in workspaces:
        for node in metadata["resolve"]["nodes"]:
            nodes.setdefault(node["id"], {"deps": []})["deps"].extend(node["deps"])
    named = ("guardsplat-server", "guardsplat-worker", "guardsplat-client", "guardsplat-credentials")
    members = {i for metadata in workspaces for i in metadata["workspace_members"]}
    programs = [i for i in members if packages[i]["name"] in named]
    inside = reached(nodes, programs)
    bill = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": {"type": "application", "bom-ref": "guardsplat", "name": "guardsplat"}},
        "components": [component(packages[i], i in programs) for i in sorted(inside)],
        "dependencies": [
            {
                "ref": purl(packages[i]),
                "dependsOn": sorted(
                    {
                        purl(packages[d["pkg"]])
                        for d in nodes[i]["deps"]
                        if d["pkg"] in inside and any(kind["kind"] != "dev" for kind in d["dep_kinds"])
                    }
                ),
            }
            for i in sorted(inside)
        ],
    }
    with open(path, "w", encoding="utf-8") as file:
        json.dump(bill, file, indent=1)
    print(f"{path}: {len(bill['components'])} components")


if __name__ == "__main__":
    main(sys.argv[1])
