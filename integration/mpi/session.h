// SPDX-License-Identifier: Apache-2.0
// A process as a rank of MPI.
// Tested by tests/tools/tiles_mpi.sh.
#pragma once

namespace bilayer::mpi {

/// Starts MPI, and ends it in the destructor. One per process.
class Session {
  public:
    Session(int& count, char**& arguments);
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    int rank() const;
    int count() const;

    /// Returns when all ranks wait.
    void wait() const;

    /// Ends all ranks: after an error, the others would wait forever.
    [[noreturn]] void abort(int status) const;
};

}  // namespace bilayer::mpi
