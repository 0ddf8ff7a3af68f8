// tessera-rig receive: packets from several cameras at once into one journal.
#include <fmt/format.h>
#include <signal.h>
#include <sys/signalfd.h>

#include <chrono>
#include <algorithm>
#include <cstdio>
#include <memory>

#include "host/rig/announce.h"
#include "host/rig/commands.h"
#include "host/rig/progress.h"
#include "host/rig/receiver.h"

namespace rig {

namespace {

using Clock = std::chrono::steady_clock;

struct ReceiveOptions {
  std::string listen, journal, port_file;
  bool append = false, until_closed = false, quiet = false;
  unsigned cameras = 0;  // 0: not stated
  double timeout_s = 0;
};

// A camera that lost its connection is back within this time, or it has ended.
constexpr std::chrono::milliseconds kGrace{300};
constexpr int kPollMs = 100;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// SIGINT and SIGTERM become readable here instead of ending the program; a file that may not grow
// becomes an error of write instead of a signal.
UniqueFd catch_signals() {
  signal(SIGXFSZ, SIG_IGN);
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  sigprocmask(SIG_BLOCK, &set, nullptr);
  return UniqueFd(signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC));
}

bool was_signalled(int fd) {
  signalfd_siginfo info;
  return read(fd, &info, sizeof info) == static_cast<ssize_t>(sizeof info);
}

// Reads what lies ready when the end is asked for; bounded, since cameras may go on sending.
Status take_what_has_come(Listener& listener, Receiver& receiver) {
  constexpr int kRounds = 16;
  uint64_t bytes = receiver.bytes() + 1;
  for (int i = 0; i < kRounds && receiver.bytes() != bytes; i++) {
    bytes = receiver.bytes();
    const Status status = listener.poll(0, -1, receiver.events());
    if (!status.ok()) return status;
  }
  return receiver.journal_status();
}

// Receives until there is a reason to end; that reason, where it is a failure.
Status receive_until_end(const ReceiveOptions& options, Listener& listener, Receiver& receiver,
                         JournalWriter& journal, int signals, Progress& progress) {
  const Listener::Events events = receiver.events();
  Clock::time_point last_bytes = Clock::now();
  Clock::time_point last_open = last_bytes;
  uint64_t bytes = 0;
  for (;;) {
    Status status = listener.poll(kPollMs, signals, events);
    if (status.ok()) status = receiver.journal_status();
    if (status.ok()) status = journal.sync_when_due();
    if (!status.ok()) return status;
    progress.show([&] { return receiver.summary(); });
    if (receiver.bytes() != bytes) last_bytes = Clock::now();
    bytes = receiver.bytes();
    if (listener.connections() > 0) last_open = Clock::now();
    if (was_signalled(signals)) {
      progress.line("ending as asked");
      return take_what_has_come(listener, receiver);
    }
    const bool all_came = receiver.cameras().size() >= std::max(options.cameras, 1u);
    const bool may_end = options.until_closed || options.cameras > 0;
    if (may_end && all_came && listener.connections() == 0 && Clock::now() - last_open > kGrace) {
      return Status();
    }
    if (options.timeout_s > 0 && seconds_since(last_bytes) > options.timeout_s) {
      return Status::failure(
          fmt::format("nothing came for {} s ({}); check that the cameras run and send to port {}; "
                      "what came is kept in {}",
                      options.timeout_s, receiver.summary(), listener.port(), options.journal));
    }
  }
}

Status receive(const ReceiveOptions& options) {
  const UniqueFd signals = catch_signals();
  if (!signals.ok()) return Status::failure("cannot wait for signals");
  Result<Listener> listener = Listener::open(options.listen);
  if (!listener.ok()) return listener.status();
  Result<JournalWriter> journal = options.append ? JournalWriter::append(options.journal)
                                                 : JournalWriter::create(options.journal);
  if (!journal.ok()) return journal.status();
  Status status = announce_port(listener.value().port(), options.listen, options.port_file);
  if (!status.ok()) return status;

  Progress progress(options.quiet);
  JournalWriter& writer = journal.value();
  if (writer.records_before() > 0 || writer.cut_bytes() > 0) {
    progress.line(fmt::format("{} holds {} records; cut off {} bytes of a torn one",
                              options.journal, writer.records_before(), writer.cut_bytes()));
  }
  progress.line(fmt::format("listening on port {}, writing {}", listener.value().port(),
                            options.journal));
  Receiver receiver(writer, [&](const std::string& text) { progress.line(text); });
  status = receive_until_end(options, listener.value(), receiver, writer, signals.get(), progress);
  receiver.finish();
  const Status closed = writer.close();
  progress.line(fmt::format("{}: {} packets ({})", options.journal, receiver.packets(),
                            receiver.summary()));
  if (!status.ok()) return status;
  if (!closed.ok()) return closed;
  if (receiver.faults() > 0) {
    return Status::failure(fmt::format("{} fault{} on connections, first {}; all good packets are "
                                       "in {}", receiver.faults(),
                                       receiver.faults() == 1 ? "" : "s", receiver.first_fault(),
                                       options.journal));
  }
  return Status();
}

}  // namespace

void add_receive(CLI::App& app) {
  const auto options = std::make_shared<ReceiveOptions>();
  CLI::App* command = app.add_subcommand(
      "receive", "Write packets from several cameras at once into one journal");
  command->add_option("--listen", options->listen,
                      "ADDR:PORT to listen on, :PORT for all addresses; port 0: the system chooses "
                      "one, which is printed")->required();
  command->add_option("--journal", options->journal, "File to write, see JOURNAL.md")->required();
  command->add_flag("--append", options->append, "Go on writing a journal that exists");
  command->add_option("--cameras", options->cameras,
                      "End once so many cameras have sent packets and all have closed")
      ->check(CLI::Range(1u, 256u));
  command->add_flag("--until-closed", options->until_closed,
                    "The same as --cameras 1: end when all that came have closed");
  command->add_option("--timeout", options->timeout_s,
                      "End with a failure when nothing comes for so many seconds; 0: wait for ever")
      ->check(CLI::Range(0.0, 1e6))->capture_default_str();
  command->add_option("--port-file", options->port_file, "Write the port's number into this file");
  command->add_flag("--quiet", options->quiet, "Say nothing but failures");
  command->callback([options] { finish(receive(*options)); });
}

}  // namespace rig
