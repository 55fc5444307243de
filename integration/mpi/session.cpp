// SPDX-License-Identifier: Apache-2.0
#include "integration/mpi/session.h"

#include <mpi.h>

#include <cstdlib>

namespace bilayer::mpi {

Session::Session(int& count, char**& arguments) {
    MPI_Init(&count, &arguments);
}

Session::~Session() {
    MPI_Finalize();
}

int Session::rank() const {
    int rank = 0;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    return rank;
}

int Session::count() const {
    int count = 0;
    MPI_Comm_size(MPI_COMM_WORLD, &count);
    return count;
}

void Session::wait() const {
    MPI_Barrier(MPI_COMM_WORLD);
}

void Session::abort(int status) const {
    MPI_Abort(MPI_COMM_WORLD, status);
    std::_Exit(status);
}

}  // namespace bilayer::mpi
