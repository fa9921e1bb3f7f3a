// A loop at 1 kHz: the latest reading in; contacts, wrench and CoP out.
//
//     loop CALIBRATION [NOISE] < readings.csv      one reading in a line, numbers separated by commas or spaces
//     loop CALIBRATION [NOISE] --udp 5005          one reading in a datagram, 16-bit numbers, low byte first
//
// A controller does what is in `act`. The loop prints at 10 Hz, because printing takes longer than a cycle.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <thread>

#ifdef __unix__
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>
#endif

#include "skin_calib_json.hpp"

using namespace skin_calib;

namespace {

// Where readings come from.
class Source {
public:
    // Open a UDP port, or standard input for port 0.
    explicit Source(int port) {
#ifdef __unix__
        if (port == 0) return;
        socket_ = socket(AF_INET, SOCK_DGRAM, 0);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK); // INADDR_ANY: also from other computers
        if (bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
            std::perror("bind");
            std::exit(1);
        }
#else
        if (port != 0) std::exit((std::puts("--udp needs a Unix system"), 1));
#endif
    }

    // Get the next reading, or the newest one that has arrived; return whether there will be more.
    bool next(std::vector<double>& readings, bool& is_new) {
        is_new = false;
#ifdef __unix__
        std::uint8_t bytes[65536];
        ssize_t size = 0;
        while (socket_ >= 0 && (size = recv(socket_, bytes, sizeof bytes, MSG_DONTWAIT)) > 0) {
            readings.resize(static_cast<std::size_t>(size) / 2);
            for (std::size_t k = 0; k < readings.size(); ++k) readings[k] = bytes[2 * k] + 256 * bytes[2 * k + 1];
            is_new = true;
        }
        if (socket_ >= 0) return true;
#endif
        std::string line;
        if (!std::getline(std::cin, line)) return false;
        readings.clear();
        for (char* start = line.data(); *start != '\0';) {
            char* end = start;
            const double x = std::strtod(start, &end);
            if (end == start)
                end = start + 1; // a separator
            else
                readings.push_back(x);
            start = end;
        }
        is_new = true;
        return true;
    }

private:
    int socket_ = -1;
};

// What a controller would do with a frame.
void act(const Frame& frame, long cycle) {
    if (cycle % 100 != 0) return;
    std::printf("%.3f s: %zu contacts, %.2f N", frame.time, frame.contacts.size(), frame.load);
    for (const Contact& c : frame.contacts)
        std::printf("; contact %lld of %.2f N at (%.1f, %.1f, %.1f) mm", static_cast<long long>(c.number), c.force,
                    1e3 * c.position[0], 1e3 * c.position[1], 1e3 * c.position[2]);
    if (frame.cop)
        std::printf("; CoP (%.1f, %.1f) mm", 1e3 * (*frame.cop)[0], 1e3 * (*frame.cop)[1]);
    else
        std::printf("; no CoP: %s", text(frame.reason));
    for (unsigned k = 0; k < std::size(flag::names); ++k)
        if (frame.flags & (1u << k)) std::printf("; %s", flag::names[k]);
    std::printf("\n");
    std::fflush(stdout);
}

} // namespace

int main(int count, char** arguments) {
    std::string files[2];
    int file_count = 0, port = 0;
    for (int k = 1; k < count; ++k) {
        if (std::strcmp(arguments[k], "--udp") == 0 && k + 1 < count)
            port = std::atoi(arguments[++k]);
        else if (file_count < 2)
            files[file_count++] = arguments[k];
    }
    Skin skin;
    const Status status = load(files[0], files[1], {}, skin);
    if (!status.ok) {
        std::fprintf(stderr, "%s\n", status.message.c_str());
        return 1;
    }
    Source source(port);
    std::vector<double> readings;
    readings.reserve(65536);
    const auto start = std::chrono::steady_clock::now();
    auto wake = start;
    bool is_new = false;
    for (long cycle = 0; source.next(readings, is_new); ++cycle) {
        const double time = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (is_new) act(skin.update(readings.data(), readings.size(), time), cycle);
        wake += std::chrono::milliseconds(1);
        std::this_thread::sleep_until(wake);
    }
}
