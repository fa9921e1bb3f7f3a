// Readings that cannot be trusted, by one frame and by the frames before it. See runtime/faults.py, which explains the
// limits.
#pragma once

#include "byte_order.hpp"
#include "clock.hpp"

namespace skin_calib {

// Keep when each reading last changed, and the faults of the last second.
class Faults {
public:
    ByteOrder byte_order;
    bool is_new = true; // whether a reading of the frame is not that of the frame before

    // Set the responses of the skin, and its noise, or nullptr. They must live as long.
    void start(const TaxelResponses& responses, const Noise* noise) {
        const std::size_t n = responses.rest.size();
        responses_ = &responses;
        byte_order.start(responses);
        unchanged_.assign(n, 0), last_.assign(n, not_a_number), since_.assign(n, infinity);
        below_rest_ = -infinity, oldest_ = time_ = infinity;
        set_noise(noise);
    }

    // Set the noise of the skin, or nullptr; the past stays.
    void set_noise(const Noise* noise) {
        noise_ = noise;
        min_repeats_ = noise ? *std::min_element(noise->repeats.begin(), noise->repeats.end()) : infinity;
        has_dead_ = noise && std::find(noise->dead.begin(), noise->dead.end(), 1) != noise->dead.end();
    }

    // Compare readings (n,) with those of the last frame.
    void compare(const Numbers& raw) noexcept {
        is_new = false;
        for (std::size_t i = 0; i < raw.size(); ++i) {
            unchanged_[i] = raw[i] == last_[i];
            is_new = is_new || !unchanged_[i];
        }
    }

    // Return the flags of a frame, and set which taxels (n,) are stuck.
    //   raw, shifted, signed_readings: (n,) as sent, as the responses take them, and corrected; known, active: (n,)
    Flags find(const Numbers& raw, const Numbers& shifted, const Numbers& signed_readings, const Booleans& known,
               const Booleans& active, double time, double period, Booleans& stuck) noexcept {
        Flags flags = 0;
        period = std::max(period, max_reading_period);
        if (find_stuck(active, time, period, stuck)) flags |= flag::stuck;
        if (is_below_rest(shifted, signed_readings, known, time)) flags |= flag::below_rest;
        if (byte_order.is_wrong(raw, time)) flags |= flag::byte_order;
        if (has_dead_) flags |= flag::dead;
        if (noise_ && !is_new) {
            const double limit = std::max(frozen_time, noise_->frame_repeats * period);
            if (*std::max_element(since_.begin(), since_.end()) < time - limit) flags |= flag::frozen;
        }
        return flags;
    }

    // Store readings (n,) and when each of them last changed; after a step back in time, from this time on [s].
    void accept(const Numbers& raw, double time) noexcept {
        if (!std::isfinite(time)) return;
        for (std::size_t i = 0; i < raw.size(); ++i) {
            if (time < time_) since_[i] = std::min(since_[i], time);
            if (!unchanged_[i]) since_[i] = time;
            last_[i] = raw[i];
        }
        oldest_ = std::min(oldest_, time);
        time_ = time;
    }

private:
    static constexpr double max_negative = 5.0;                                                                // [N]
    static constexpr double fault_time = 1.0, stuck_time = 30.0, frozen_time = 0.1, max_reading_period = 0.02; // [s]

    // Find the active taxels (n,) that have not changed for longer than the noise, or the limit, allows.
    bool find_stuck(const Booleans& active, double time, double period, Booleans& stuck) noexcept {
        std::fill(stuck.begin(), stuck.end(), 0);
        if (!std::isfinite(time)) return false;
        if (oldest_ >= time - std::min(min_repeats_ * period, stuck_time)) return false;
        oldest_ = *std::min_element(since_.begin(), since_.end());
        bool any = false;
        for (std::size_t i = 0; i < stuck.size(); ++i) {
            const double limit = noise_ ? std::min(noise_->repeats[i] * period, stuck_time) : stuck_time;
            stuck[i] = unchanged_[i] && active[i] && since_[i] < time - limit;
            any = any || stuck[i];
        }
        return any;
    }

    // Return whether a known taxel reads less than its noise without contact can give, now or a second before.
    bool is_below_rest(const Numbers& shifted, const Numbers& signed_readings, const Booleans& known,
                       double time) noexcept {
        bool is_now = false;
        for (std::size_t i = 0; i < known.size() && !is_now; ++i) {
            if (!known[i]) continue;
            const double rest = responses_->rest[i], sign = responses_->sign[i];
            if (noise_)
                is_now = signed_readings[i] < noise_->lowest[i];
            else
                is_now = shifted[i] * sign < rest * sign && responses_->force(i, 2 * rest - shifted[i]) > max_negative;
        }
        if (is_now && std::isfinite(time)) below_rest_ = time;
        return is_now || (0 <= time - below_rest_ && time - below_rest_ < fault_time);
    }

    const TaxelResponses* responses_ = nullptr;
    const Noise* noise_ = nullptr;
    Booleans unchanged_;            // (n,) which readings equal those of the last frame in every bit
    Numbers last_, since_;          // (n,) readings of the last frame; when each of them last changed [s]
    double below_rest_ = -infinity; // time of the last frame with a reading below rest
    double oldest_ = infinity;      // all readings have been the same since this time, or a later one
    double time_ = infinity;        // of the last frame
    double min_repeats_ = infinity;
    bool has_dead_ = false;
};

} // namespace skin_calib
