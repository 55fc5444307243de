// SPDX-License-Identifier: Apache-2.0
// `bilayer`: fields from meshes on the command line. Exit status 0: done; 1: input or machine at fault, one line on
// stderr; 2: wrong usage.
// Tested by tests/tools/main.cpp through the program.
#include "tools/command_line.h"
#include "tools/commands.h"
#include "tools/tiles/ranks.h"

int main(int count, char** arguments) {
    bilayer::tools::prepareProcess();
    CLI::App app("Narrow-band signed distance fields from triangle meshes, in OpenVDB files.", "bilayer");
    app.set_version_flag("--version", bilayer::tools::versions());
    app.require_subcommand(1);
    bilayer::tools::addBuild(app, {});
    bilayer::tools::addMerge(app);
    bilayer::tools::addBatch(app);
    bilayer::tools::addInspect(app);
    bilayer::tools::addInfo(app);
    bilayer::tools::addQuery(app);
    bilayer::tools::addSurface(app);
    bilayer::tools::addExport(app);
    bilayer::tools::addSeed(app);
    bilayer::tools::addDevices(app);
    return bilayer::tools::runCommandLine(app, count, arguments);
}
