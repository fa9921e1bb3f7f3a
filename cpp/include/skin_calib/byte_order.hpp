// Readings of two bytes that arrive in the wrong order. See runtime/byte_order.py, which explains the limits.
#pragma once

#include <cstdlib>

#include "learning.hpp"

namespace skin_calib {

// Compare the changes of the readings as they are with those after the bytes are swapped.
class ByteOrder {
public:
    // Set the responses of the skin.
    void start(const TaxelResponses& responses) {
        const std::size_t n = responses.rest.size();
        double range = 0;
        for (std::size_t i = 0; i < n; ++i) range = std::max(range, std::abs(responses.full[i] - responses.rest[i]));
        has_low_bytes_ = range < 4096.0;
        before_.assign(n, 0.0);
        has_before_ = false, time_ = -infinity, right_ = wrong_ = all_ = 0;
    }

    // Note whether readings without contact have a lower byte.
    void learn(const Frames& rows) noexcept {
        for (double x : rows.values) has_low_bytes_ = has_low_bytes_ || (std::isfinite(x) && std::fmod(x, 256) != 0);
    }

    // Return whether the bytes of the last readings (n,) are in the wrong order.
    bool is_wrong(const Numbers& readings, double time) noexcept {
        constexpr double look_period = 0.02, min_count = 6.0, min_fraction = 0.9, min_decided = 0.6;
        if (!(0 <= time - time_ && time - time_ < look_period)) {
            look(readings);
            time_ = time;
        }
        return wrong_ >= min_count && wrong_ >= min_fraction * (wrong_ + right_) && wrong_ >= min_decided * all_;
    }

private:
    static constexpr double word = 65536;

    static bool is_change(double before, double after) noexcept {
        return std::abs(before) < word && std::abs(after) < word && before != after;
    }

    // Swap the two lower bytes of a number.
    static std::int64_t swapped(std::int64_t number, bool is_signed) noexcept {
        const auto low = static_cast<std::uint16_t>(static_cast<std::uint64_t>(number) & 65535u);
        const auto other = static_cast<std::uint16_t>((low << 8) | (low >> 8));
        return is_signed && other >= 32768 ? std::int64_t{other} - 65536 : std::int64_t{other};
    }

    // Count the changes of readings (n,) since the last look that are smooth in one order and wild in the other.
    void look(const Numbers& readings) noexcept {
        constexpr std::int64_t wild_ratio = 16;
        constexpr double kept_fraction = 0.85;
        bool is_signed = false;
        std::size_t right = 0, wrong = 0, all = 0;
        for (std::size_t i = 0; has_before_ && i < readings.size(); ++i) {
            if (!is_change(before_[i], readings[i])) continue;
            const auto a = static_cast<std::int64_t>(before_[i]), b = static_cast<std::int64_t>(readings[i]);
            is_signed = is_signed || a < 0 || b < 0;
            has_low_bytes_ = has_low_bytes_ || ((a | b) & 255) != 0;
        }
        for (std::size_t i = 0; has_before_ && i < readings.size(); ++i) {
            if (!is_change(before_[i], readings[i])) continue;
            const auto a = static_cast<std::int64_t>(before_[i]), b = static_cast<std::int64_t>(readings[i]);
            const bool is_whole = static_cast<double>(a) == before_[i] && static_cast<double>(b) == readings[i];
            const std::int64_t change = std::abs(b - a);
            const std::int64_t other = std::abs(swapped(b, is_signed) - swapped(a, is_signed));
            right += !is_whole || wild_ratio * change <= other;
            wrong += is_whole && wild_ratio * other <= change;
            ++all;
        }
        if (has_before_) {
            right_ = kept_fraction * right_ + static_cast<double>(right);
            wrong_ = kept_fraction * wrong_ + static_cast<double>(has_low_bytes_ ? wrong : 0);
            all_ = kept_fraction * all_ + static_cast<double>(all);
        }
        std::copy(readings.begin(), readings.end(), before_.begin());
        has_before_ = true;
    }

    bool has_low_bytes_ = false, has_before_ = false;
    Numbers before_;
    double time_ = -infinity, right_ = 0, wrong_ = 0, all_ = 0;
};

} // namespace skin_calib
