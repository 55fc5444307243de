// SPDX-License-Identifier: Apache-2.0
// `mpirun -n R bilayer-mpi build MESH --tiles AxBxC -o FOLDER ...`: the tiles of `bilayer build`, spread over the ranks
// of MPI. The options and the exit status are those of `bilayer`. tests/tools/tiles_mpi.sh runs it.
// Tested by tests/tools/tiles.cpp through the program.
#include "integration/mpi/session.h"
#include "tools/command_line.h"
#include "tools/commands.h"
#include "tools/tiles/ranks.h"

int main(int count, char** arguments) {
    bilayer::tools::prepareProcess();
    const bilayer::mpi::Session session(count, arguments);
    CLI::App app("Signed distance fields in tiles, by the ranks of MPI.", "bilayer-mpi");
    app.set_version_flag("--version", bilayer::tools::versions());
    app.require_subcommand(1);
    bilayer::tools::addBuild(app, {session.rank(), session.count(), [&] { session.wait(); }});
    const int status = bilayer::tools::runCommandLine(app, count, arguments);
    if (status != bilayer::tools::done && session.count() > 1) session.abort(status);
    return status;
}
