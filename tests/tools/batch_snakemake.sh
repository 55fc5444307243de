#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# batch_snakemake.sh BILAYER FOLDER: the Snakefile of docs/batch.md makes the fields that a batch makes, and one rule that
# fails leaves the others.
source "$(dirname "$0")/batch_shared.sh"
need snakemake awk
bilayer=$1 work=$2
rm -rf "$work" && mkdir -p "$work" && cd "$work"
make_library meshes 8
cat >Snakefile <<TEXT
NAMES = glob_wildcards("meshes/{name}.obj").name

rule all:
    input: expand("fields/meshes/{name}.obj.vdb", name=NAMES)

rule field:
    input: "meshes/{name}.obj"
    output: "fields/meshes/{name}.obj.vdb"
    threads: 1
    shell: "$bilayer batch {input} -o fields --threads {threads} --resolution 32"
TEXT
HOME=$work snakemake --cores 2 --quiet >snakemake.txt 2>&1 || { cat snakemake.txt; exit 1; }
"$bilayer" batch meshes/*/*.obj -o direct --resolution 32 >/dev/null
require_same fields direct

# a mesh that is bad fails alone
echo "no mesh" >meshes/a/bad.obj
! HOME=$work snakemake --cores 2 --quiet --keep-going >snakemake.txt 2>&1 || { echo "a bad mesh was not reported"; exit 1; }
require_same fields direct
"$bilayer" batch --report fields | grep -q 'bad.obj: error: ' || { echo "the report lacks the bad mesh"; exit 1; }
echo "8 meshes by Snakemake, as by one batch"
