// The state feedback of fly.py in C++17, by plain HTTP through http_bridge.py; POSIX sockets, no libraries.
//     g++ -O2 -std=c++17 -o fly fly.cpp && ./fly 10 8050
#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

using Task = std::map<std::string, std::vector<double>>;

class Connection {
 public:
  explicit Connection(int port) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    const char* home = std::getenv("HOME");
    std::ifstream(std::string(home ? home : ".") + "/.http_bridge.key") >> key_;
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error("no connection: is http_bridge.py running?");
    const int one = 1;
    setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
  }
  ~Connection() { close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Body of the reply; everything but status 200 is an error.
  std::string post(const std::string& path, const std::string& body) {
    std::ostringstream request;
    request << "POST " << path << " HTTP/1.1\r\nHost: localhost\r\nX-Key: " << key_
            << "\r\nContent-Length: " << body.size() << "\r\n\r\n" << body;
    const std::string text = request.str();
    if (write(socket_, text.data(), text.size()) != static_cast<ssize_t>(text.size()))
      throw std::runtime_error("the bridge is gone");
    std::string head;
    while (head.find("\r\n\r\n") == std::string::npos) head += received();
    const size_t begin = head.find("\r\n\r\n") + 4;
    std::string content = head.substr(begin);
    const size_t length = std::stoul(head.substr(head.find("Content-Length: ") + 16));
    while (content.size() < length) content += received();
    if (head.compare(9, 3, "200") != 0) throw std::runtime_error(content);
    return content;
  }

 private:
  std::string received() {
    std::array<char, 4096> data;
    const ssize_t count = read(socket_, data.data(), data.size());
    if (count <= 0) throw std::runtime_error("the bridge is gone");
    return {data.data(), static_cast<size_t>(count)};
  }
  int socket_;
  std::string key_;
};

Task parsed(const std::string& text) {
  Task task;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string name;
    words >> name;
    for (double value; words >> value;) task[name].push_back(value);
  }
  return task;
}

// Inputs that pull the vehicle to the first stage of its reference: pitch, roll, thrust, yaw.
std::array<double, 4> feedback(const Task& task) {
  constexpr std::array<double, 4> position_gain{3, 3, 6, 6}, velocity_gain{3, 3, 5, 5};
  const auto &motion = task.at("motion"), &reference = task.at("reference");
  const double c = std::cos(motion[3]), s = std::sin(motion[3]);
  std::array<double, 4> error{}, rate{}, inputs{};
  for (int axis = 0; axis < 4; ++axis) {
    error[axis] = reference[axis] - motion[axis];
    rate[axis] = reference[4 + axis];
  }
  error = {c * error[0] + s * error[1], -s * error[0] + c * error[1], error[2], error[3]};
  rate = {c * rate[0] + s * rate[1], -s * rate[0] + c * rate[1], rate[2], rate[3]};
  for (int axis = 0; axis < 4; ++axis) {
    const double acceleration = position_gain[axis] * error[axis] +
                                velocity_gain[axis] * (rate[axis] - motion[4 + axis]) -
                                task.at("disturbance")[axis];
    const double value = task.at("hover_input")[axis] + acceleration / task.at("input_gain")[axis];
    inputs[axis] = std::clamp(value, task.at("input_min")[axis], task.at("input_max")[axis]);
  }
  return inputs;
}

int main(int count, char** arguments) try {
  using Clock = std::chrono::steady_clock;
  const double seconds = count > 1 ? std::stod(arguments[1]) : 10.0;
  Connection bridge(count > 2 ? std::stoi(arguments[2]) : 8050);
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  Task task = parsed(bridge.post("/take", ""));
  while (Clock::now() < end) {
    std::ostringstream answer;
    answer.precision(17);
    answer << static_cast<long long>(task.at("number")[0]);
    for (const double value : feedback(task)) answer << ' ' << value;
    task = parsed(bridge.post("/answer", answer.str()));
  }
  bridge.post("/release", "");
} catch (const std::exception& error) {
  std::cerr << "error: " << error.what() << '\n';
  return 1;
}
