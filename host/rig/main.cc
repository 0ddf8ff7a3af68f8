// tessera-rig: the table of its subcommands, and how each of them ends.
#include <cstdio>
#include <exception>

#include "common/version.h"
#include "host/rig/commands.h"

namespace rig {

void finish(const Status& status) {
  if (!status.ok()) {
    std::fprintf(stderr, "tessera-rig: %s\n", status.sentence().c_str());
    throw CLI::RuntimeError(1);
  }
}

}  // namespace rig

int main(int argc, char** argv) {
  CLI::App app{"Calibrates a rig of cameras from what they saw of a Tessera target", "tessera-rig"};
  app.set_version_flag("--version", "tessera-rig " TESSERA_VERSION);
  app.require_subcommand(1);
  try {
    rig::add_receive(app);
    rig::add_journal(app);
    rig::add_solve(app);
    rig::add_report(app);
    rig::add_uncertainty(app);
    rig::add_compare(app);
    rig::add_export(app);
    rig::add_project(app);
    rig::add_unproject(app);
    app.parse(argc, argv);
  } catch (const CLI::RuntimeError& error) {
    return error.get_exit_code();
  } catch (const CLI::ParseError& error) {
    // --help and --version are "errors" of CLI11 with status 0; all others are wrong use.
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tessera-rig: %s\n", error.what());
    return 1;
  }
  return 0;
}
