// SPDX-License-Identifier: Apache-2.0
// Warnings of this library.
// Tested by tests/bullet/stock.cpp through setWarningCallback().
#pragma once

namespace bilayer::bullet::detail {

/// Passes a message to the user's callback, or prints it as a line on the standard error output. From any thread.
void warn(const char* message);

/// The same, but each message only once until setWarningCallback() is called.
/// @param message  a string literal
void warnOnce(const char* message);

}  // namespace bilayer::bullet::detail
