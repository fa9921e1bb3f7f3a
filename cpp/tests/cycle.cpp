// Time the cycle of the C++ runtime: all results of each frame. See cycle.py, which calls it.
//     cycle CALIBRATION NOISE_OR_EMPTY READINGS FRAMES      readings: rows of 16-bit numbers
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "skin_calib_json.hpp"

using namespace skin_calib;

// Return the time of this thread on the processor [us]: other programs hardly count.
static double now() {
    std::timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

int main(int count, char** arguments) {
    if (count != 5) return 2;
    Skin skin;
    Options options;
    if (arguments[2][0] == '\0') options.switch_on = 0.2;
    if (const Status status = load(arguments[1], arguments[2], options, skin); !status.ok)
        return std::puts(status.message.c_str()), 1;
    const std::string bytes = reading::contents(arguments[3]);
    const std::size_t n = skin.reading_length(), rows = bytes.size() / 2 / n,
                      frames = std::strtoul(arguments[4], nullptr, 10);
    const auto* readings = reinterpret_cast<const std::uint16_t*>(bytes.data());
    if (rows == 0 || frames == 0) return 2;
    Numbers times;
    times.reserve(frames);
    std::size_t contacts = 0, known = 0;
    for (std::size_t k = 0; k < frames + 100; ++k) {
        const double start = now();
        const Frame& frame = skin.update(readings + (k % rows) * n, n, 1e-3 * static_cast<double>(k));
        const double time = now() - start;
        if (k >= 100) times.push_back(time); // the first ones fill the caches
        contacts += frame.contacts.size(), known += frame.cop.has_value();
    }
    std::sort(times.begin(), times.end());
    const auto quantile = [&](double q) {
        return times[std::min(frames - 1, static_cast<std::size_t>(q * static_cast<double>(frames)))];
    };
    std::printf("%.2f %.2f %.2f %.2f %.2f\n", quantile(0.5), quantile(0.99), times.back(),
                static_cast<double>(contacts) / static_cast<double>(frames + 100),
                static_cast<double>(known) / static_cast<double>(frames + 100));
}
