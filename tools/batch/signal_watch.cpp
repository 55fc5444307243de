// SPDX-License-Identifier: Apache-2.0
#include "tools/batch/signal_watch.h"

#include <sys/signalfd.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace bilayer::tools {

SignalWatch::SignalWatch() {
    sigset_t ending;
    sigemptyset(&ending);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&ending, signal);
    ::sigprocmask(SIG_BLOCK, &ending, &before_);
    file_ = ::signalfd(-1, &ending, SFD_NONBLOCK | SFD_CLOEXEC);
    if (file_ < 0) throw std::system_error(errno, std::generic_category(), "signalfd");
}

SignalWatch::~SignalWatch() {
    ::close(file_);
    ::sigprocmask(SIG_SETMASK, &before_, nullptr);
}

int SignalWatch::arrived() const {
    signalfd_siginfo info{};
    return ::read(file_, &info, sizeof info) == ssize_t(sizeof info) ? int(info.ssi_signo) : 0;
}

}  // namespace bilayer::tools
