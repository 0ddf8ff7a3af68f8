// One poll loop over all connections; a slow or broken one never holds up the others.
#include "host/net/listener.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <memory>

namespace rig {

namespace {

constexpr size_t kConnectionsMax = 256;
constexpr size_t kReadBytes = 1 << 18;
constexpr int kBacklog = 64;

struct HostPort {
  std::string host, port;
};

Result<HostPort> parse(const std::string& address) {
  const Status wrong = Status::failure(
      "--listen " + address + ": write ADDR:PORT, for example 127.0.0.1:7400, [::1]:7400, or :7400 "
      "for all addresses");
  const size_t colon = address.rfind(':');
  if (colon == std::string::npos) return wrong;
  HostPort at{address.substr(0, colon), address.substr(colon + 1)};
  if (at.host.size() >= 2 && at.host.front() == '[' && at.host.back() == ']') {
    at.host = at.host.substr(1, at.host.size() - 2);
  } else if (at.host.find(':') != std::string::npos) {
    return wrong;
  }
  const bool is_number = !at.port.empty() && at.port.size() <= 5 &&
                         at.port.find_first_not_of("0123456789") == std::string::npos;
  if (!is_number || std::stoi(at.port) > 65535) return wrong;
  return at;
}

std::string text_of(const sockaddr_storage& address, socklen_t bytes) {
  char host[NI_MAXHOST];
  char port[NI_MAXSERV];
  if (getnameinfo(reinterpret_cast<const sockaddr*>(&address), bytes, host, sizeof host, port,
                  sizeof port, NI_NUMERICHOST | NI_NUMERICSERV) != 0) {
    return "unknown";
  }
  std::string name = host;
  // An IPv4 camera on a socket for both kinds is shown as what it is.
  if (name.rfind("::ffff:", 0) == 0) name.erase(0, 7);
  return name.find(':') != std::string::npos ? "[" + name + "]:" + port : name + ":" + port;
}

// A camera that lost its power says nothing: ask after it when nothing comes.
void notice_death(int fd) {
  const int yes = 1;
  const int idle_s = 10;
  const int interval_s = 5;
  const int questions = 3;
  static_cast<void>(::setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &yes, sizeof yes));
  static_cast<void>(::setsockopt(fd, IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s));
  static_cast<void>(::setsockopt(fd, IPPROTO_TCP, TCP_KEEPINTVL, &interval_s, sizeof interval_s));
  static_cast<void>(::setsockopt(fd, IPPROTO_TCP, TCP_KEEPCNT, &questions, sizeof questions));
}

UniqueFd listen_on(const addrinfo& at) {
  UniqueFd fd(::socket(at.ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd.ok()) return UniqueFd();
  const int yes = 1;
  const int no = 0;
  static_cast<void>(::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes));
  if (at.ai_family == AF_INET6) {
    static_cast<void>(::setsockopt(fd.get(), IPPROTO_IPV6, IPV6_V6ONLY, &no, sizeof no));
  }
  if (::bind(fd.get(), at.ai_addr, at.ai_addrlen) != 0 || ::listen(fd.get(), kBacklog) != 0) {
    const int error = errno;
    fd = UniqueFd();
    errno = error;
  }
  return fd;
}

}  // namespace

Result<Listener> Listener::open(const std::string& address) {
  const Result<HostPort> at = parse(address);
  if (!at.ok()) return at.status();
  addrinfo hints = {};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* list = nullptr;
  const std::string& host = at.value().host;
  const int error = getaddrinfo(host.empty() ? nullptr : host.c_str(), at.value().port.c_str(),
                                &hints, &list);
  if (error != 0) {
    return Status::failure(fmt::format("--listen {}: {}; name an address of this machine", address,
                                       gai_strerror(error)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(list, freeaddrinfo);
  Listener listener;
  int why = 0;
  // For all addresses the IPv6 socket comes first: it takes IPv4 too.
  for (const int family : {AF_INET6, AF_INET}) {
    for (const addrinfo* it = list; it != nullptr && !listener.fd_.ok(); it = it->ai_next) {
      if (it->ai_family != family) continue;
      listener.fd_ = listen_on(*it);
      if (!listener.fd_.ok()) why = errno;
    }
  }
  if (!listener.fd_.ok()) {
    return Status::failure(fmt::format("--listen {}: {}; choose another address or port", address,
                                       std::strerror(why)));
  }
  sockaddr_storage bound = {};
  socklen_t bytes = sizeof bound;
  if (getsockname(listener.fd_.get(), reinterpret_cast<sockaddr*>(&bound), &bytes) != 0) {
    return Status::failure(fmt::format("--listen {}: {}", address, std::strerror(errno)));
  }
  listener.port_ = ntohs(bound.ss_family == AF_INET6
                             ? reinterpret_cast<const sockaddr_in6*>(&bound)->sin6_port
                             : reinterpret_cast<const sockaddr_in*>(&bound)->sin_port);
  listener.buffer_.resize(kReadBytes);
  return listener;
}

void Listener::accept_all(const Events& events) {
  for (;;) {
    sockaddr_storage peer = {};
    socklen_t bytes = sizeof peer;
    UniqueFd fd(::accept4(fd_.get(), reinterpret_cast<sockaddr*>(&peer), &bytes,
                          SOCK_NONBLOCK | SOCK_CLOEXEC));
    // What fails here is the other side's trouble, or passes: the next poll tries again.
    if (!fd.ok()) return;
    if (connections_.size() >= kConnectionsMax) continue;
    notice_death(fd.get());
    last_connection_++;
    connections_.emplace(last_connection_, std::move(fd));
    events.on_open(last_connection_, text_of(peer, bytes));
  }
}

// False once the connection is at its end.
bool Listener::read_from(uint32_t connection, int fd, const Events& events) {
  const ssize_t got = ::recv(fd, buffer_.data(), buffer_.size(), 0);
  if (got > 0) {
    if (events.on_bytes(connection, buffer_.data(), static_cast<size_t>(got))) return true;
    events.on_close(connection, "closed by the receiver");
    return false;
  }
  if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return true;
  events.on_close(connection, got == 0 ? "" : std::strerror(errno));
  return false;
}

Status Listener::poll(int timeout_ms, int wake_fd, const Events& events) {
  std::vector<pollfd> waiting = {{wake_fd, POLLIN, 0}, {fd_.get(), POLLIN, 0}};
  std::vector<uint32_t> numbers = {0, 0};
  for (const auto& [number, fd] : connections_) {
    waiting.push_back({fd.get(), POLLIN, 0});
    numbers.push_back(number);
  }
  const int ready = ::poll(waiting.data(), waiting.size(), timeout_ms);
  if (ready < 0 && errno != EINTR) {
    return Status::failure(fmt::format("cannot wait for cameras: {}", std::strerror(errno)));
  }
  if (ready <= 0) return Status();
  if ((waiting[1].revents & (POLLERR | POLLNVAL)) != 0) {
    return Status::failure("the listening socket has failed; start receiving again");
  }
  for (size_t i = 2; i < waiting.size(); i++) {
    if (waiting[i].revents != 0 && !read_from(numbers[i], waiting[i].fd, events)) {
      connections_.erase(numbers[i]);
    }
  }
  if (waiting[1].revents != 0) accept_all(events);
  return Status();
}

}  // namespace rig
