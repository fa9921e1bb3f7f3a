// An admittance controller: a link in the air yields to the hand that pushes its skin.
//
//     admittance CALIBRATION
//
// The link behaves as a mass with a damper, m dv/dt + d v = f, where f is the force of the contacts. A simulated finger
// presses one taxel after another; a robot would send `velocity` to its joints. If the contact is not known, the link
// stops: not known is not the same as no contact.
#include <cstdio>

#include "skin_calib_json.hpp"

using namespace skin_calib;

namespace {

constexpr double mass = 2.0;       // [kg]
constexpr double damping = 20.0;   // [N s/m]
constexpr double max_speed = 0.25; // [m/s]
constexpr double period = 1e-3;    // [s]

class Admittance {
public:
    // Return the velocity of the link for the next cycle, in its own frame [m/s].
    const Vec3& update(const Frame& frame) {
        if (!frame.touched()) {
            velocity_ = {}; // the contact is not known
            return velocity_;
        }
        Vec3 force{};
        for (const Contact& c : frame.contacts) force = plus(force, {c.wrench[0], c.wrench[1], c.wrench[2]});
        const Vec3 acceleration = plus(plus({0, 0, 0}, force, 1 / mass), velocity_, -damping / mass);
        velocity_ = plus(velocity_, acceleration, period);
        const double speed = std::sqrt(dot(velocity_, velocity_));
        if (speed > max_speed) velocity_ = plus({0, 0, 0}, velocity_, max_speed / speed);
        return velocity_;
    }

private:
    Vec3 velocity_{};
};

} // namespace

int main(int count, char** arguments) {
    Skin skin;
    Options options;
    options.switch_on = 0.5; // [N] the simulated readings have no noise; with a noise file leave it out
    const Status status = load(count > 1 ? arguments[1] : "", "", options, skin);
    if (!status.ok) {
        std::fprintf(stderr, "%s\n", status.message.c_str());
        return 1;
    }
    Admittance controller;
    Numbers readings(skin.reading_length(), 0.0);
    Vec3 moved{};
    for (int k = 0; k < 1000; ++k) {
        const std::size_t pressed = static_cast<std::size_t>(k / 100) % skin.size();
        for (std::size_t i = 0; i < skin.size(); ++i) {
            const double force = i == pressed && k % 100 < 60 ? 5.0 : 0.0; // [N]
            double reading = skin.responses.rest[i]; // the simulated sensor: try readings until the force is there
            const double step = skin.responses.sign[i] * 1.0;
            for (int tries = 0; skin.responses.force(i, reading) < force && tries < 70000; ++tries) reading += step;
            readings[static_cast<std::size_t>(skin.geometry.calibration.channels[i])] = reading;
        }
        if (k == 950) readings.assign(readings.size(), not_a_number); // the cable breaks
        const Frame& frame = skin.update(readings.data(), readings.size(), period * k);
        const Vec3& v = controller.update(frame);
        moved = plus(moved, v, period);
        if (k % 50 == 0)
            std::printf(
                "%.2f s: force (%.2f, %.2f, %.2f) N, velocity (%.1f, %.1f, %.1f) mm/s, moved (%.2f, %.2f, %.2f) mm\n",
                frame.time, frame.wrench[0], frame.wrench[1], frame.wrench[2], 1e3 * v[0], 1e3 * v[1], 1e3 * v[2],
                1e3 * moved[0], 1e3 * moved[1], 1e3 * moved[2]);
    }
}
