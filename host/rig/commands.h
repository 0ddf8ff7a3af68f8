// The subcommands of tessera-rig: each file cmd_NAME.cc has one function that adds its own.
#ifndef TESSERA_HOST_RIG_COMMANDS_H
#define TESSERA_HOST_RIG_COMMANDS_H

#include <CLI/CLI.hpp>

#include "host/base/status.h"

namespace rig {

void add_receive(CLI::App& app);
void add_journal(CLI::App& app);
void add_solve(CLI::App& app);
void add_project(CLI::App& app);
void add_unproject(CLI::App& app);
void add_report(CLI::App& app);
void add_uncertainty(CLI::App& app);
void add_compare(CLI::App& app);
void add_export(CLI::App& app);

// Ends a subcommand's callback: a failure's sentence goes to standard error, and the exit status
// becomes 1.
void finish(const Status& status);

}  // namespace rig

#endif
