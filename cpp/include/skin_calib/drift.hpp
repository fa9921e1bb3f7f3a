// Drift of the readings without contact, and of their noise, since the noise was learnt. See runtime/drift.py, which
// explains the limits.
#pragma once

#include "clock.hpp"
#include "touched.hpp"

namespace skin_calib {

class Drift {
public:
    Numbers offset; // (n,) drift of the readings

    // Set what stays the same; `sign`: (n,) of the responses. Skin, noise and signs must live as long.
    void start(const SkinGeometry& skin, const Noise& noise, const Numbers& sign, bool is_followed) {
        skin_ = &skin, noise_ = &noise, sign_ = &sign, is_followed_ = is_followed;
        moved_ = not_a_number, off_ = 0;
        is_reported_ = is_positive_ = is_touched_ = has_silent_ = has_noisy_ = false;
        offset.assign(skin.n, 0.0), variance_.assign(skin.n, 1.0);
        for (auto* list : {&sum_, &squares_, &peak_, &change_, &deviation_, &sorted_, &block_variance_})
            list->assign(skin.n, 0.0);
        for (auto* list : {&silent_, &free_}) list->assign(skin.n, 0);
        largest_ = 0;
        for (std::size_t i = 0; i < skin.n; ++i) largest_ += noise.sigma[i] * noise.slopes[i];
        largest_ *= max_common;
        drop_block();
    }

    // Forget the frames since the end of the last block.
    void drop_block() noexcept {
        start_ = infinity, count_ = 0, is_mixed_ = false;
        lowest_ = infinity, highest_ = 0.0;
        next_ = -infinity;
    }

    // Return the flags of a frame with these sets, and add the silent taxels to the stuck ones (n,).
    Flags faults(const Touched& sets, Booleans& stuck) noexcept {
        double load = 0;
        if (sets.stands.value_or(true)) load = std::accumulate(sets.pushes.begin(), sets.pushes.end(), 0.0);
        if ((load > (is_touched_ ? contact_end : 1.0) * largest_) != is_touched_) { // a contact begins or ends
            is_touched_ = !is_touched_, is_mixed_ = true;
            hide();
        }
        lowest_ = std::min(lowest_, sets.common), highest_ = std::max(highest_, sets.common);
        Flags flags = 0;
        if (is_reported_ && !(is_positive_ && !sets.stands.value_or(true))) flags |= flag::drift;
        if (has_noisy_) flags |= flag::noisy;
        if (!has_silent_) return flags;
        for (std::size_t i = 0; i < skin_->n; ++i) stuck[i] |= silent_[i];
        return flags | flag::stuck;
    }

    // Return whether `add` uses a frame at this time [s].
    bool is_due(double time) const noexcept { return next_ <= time && time < infinity; }

    // Add a frame to the block; at its end, look at drift and noise.
    //   change: (n,) signed readings, not corrected, less those without contact; NaN where a taxel has none
    void add(const Numbers& change, double time) noexcept {
        if (!is_due(time)) return;
        next_ = time + frame_time;
        if (count_ == 0) {
            start_ = time, peak_ = change;
            for (auto* list : {&sum_, &squares_}) std::fill(list->begin(), list->end(), 0.0);
        }
        for (std::size_t i = 0; i < skin_->n; ++i) {
            sum_[i] += change[i];
            squares_[i] += change[i] * change[i];
            if (!(change[i] <= peak_[i])) peak_[i] = std::isnan(peak_[i]) ? peak_[i] : change[i]; // NaN stays
        }
        ++count_;
        if (count_ < block_frames || !(time - start_ >= block_time)) return;
        end_block(time);
        drop_block();
    }

private:
    static constexpr double block_time = 0.2, frame_time = 0.0035; // [s]
    static constexpr std::size_t block_frames = 6;
    static constexpr int report_blocks = 3, variance_blocks = 10;
    static constexpr double near = 1.0, relative_near = 0.5, contact_end = 0.5, possible = 2.4, drift_margin = 3.0,
                            max_drift = 0.3, max_common = 5.0;
    static constexpr double max_variance = 3.0, min_variance = 0.05, max_block_variance = 8.0, no_variance = 1e-6;
    static constexpr double tracking_time = 10.0; // [s]

    // Do not report a drift until one more block has it.
    void hide() noexcept { is_reported_ = false, off_ = std::min(off_, report_blocks - 1); }

    // Look at the free taxels of the block that ends at a time [s], and move their baseline.
    void end_block(double time) noexcept {
        const Noise& noise = *noise_;
        const std::size_t n = skin_->n;
        const double count = static_cast<double>(count_);
        std::size_t valid_count = 0;
        bool has_changed = false;
        for (std::size_t i = 0; i < n; ++i) {
            change_[i] = sum_[i] / count;
            block_variance_[i] =
                (squares_[i] - sum_[i] * change_[i]) / ((count - 1) * (noise.sigma[i] * noise.sigma[i]));
            has_changed = has_changed || block_variance_[i] > no_variance;
            change_[i] -= offset[i] * (*sign_)[i];
            deviation_[i] = change_[i] / noise.sigma[i];
            if (std::isfinite(deviation_[i])) sorted_[valid_count++] = deviation_[i];
        }
        if (!has_changed || valid_count == 0) return; // a frozen bus, or no reading
        const auto begin = sorted_.begin(), end = begin + static_cast<std::ptrdiff_t>(valid_count);
        const auto quarter = begin + std::max<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(valid_count / 4), 1) - 1;
        std::nth_element(begin, quarter, end);
        const double lowest = *quarter;
        const double alike = is_touched_ ? near : std::max(near, relative_near * lowest);
        const auto is_alike = [&](double deviation) { return std::abs(deviation - lowest) < alike; };
        const std::ptrdiff_t alike_count = std::count_if(deviation_.begin(), deviation_.end(), is_alike);
        if (lowest > max_common || 4 * static_cast<std::size_t>(alike_count) < valid_count) { // all are loaded
            hide();
            return;
        }
        find_free(lowest + possible);
        if (!is_mixed_ && highest_ - lowest_ < possible) {
            const bool has_free = std::find(free_.begin(), free_.end(), 1) != free_.end();
            double sum = 0;
            std::size_t judged = 0;
            for (std::size_t i = 0; i < n; ++i)
                if (has_free ? free_[i] : is_alike(deviation_[i])) sum += deviation_[i], ++judged;
            const double mean = sum / static_cast<double>(judged);
            judge(mean, noise.common / std::sqrt(static_cast<double>(judged) * count));
            watch_noise(mean);
        }
        if (is_followed_ && !is_loaded()) follow(time);
    }

    // Find the taxels whose deviation, and that of their neighbours, is not above a limit.
    void find_free(double limit) noexcept {
        for (std::size_t i = 0; i < skin_->n; ++i) free_[i] = std::isfinite(deviation_[i]);
        for (std::size_t i = 0; i < skin_->n; ++i) {
            if (!(deviation_[i] > limit)) continue;
            free_[i] = 0;
            for (std::size_t k = skin_->begin(i); k < skin_->end(i); ++k) free_[skin_->neighbour(k)] = 0;
        }
    }

    // Count the blocks with a mean of free taxels that is not that at rest, as its standard deviation shows.
    void judge(double mean, double sigma) noexcept {
        const bool is_off = std::abs(mean) > max_drift + drift_margin * sigma;
        off_ = is_off ? std::min(off_ + 1, report_blocks) : 0;
        is_reported_ = off_ == report_blocks, is_positive_ = mean > 0;
    }

    // Find free taxels whose noise has grown, or that send one number only; `mean`: deviation of free taxels.
    void watch_noise(double mean) noexcept {
        const double silent_readings = -std::log(min_variance) * variance_blocks * block_time / 0.02;
        has_noisy_ = has_silent_ = false;
        for (std::size_t i = 0; i < skin_->n; ++i) {
            if (free_[i] || deviation_[i] <= mean)
                variance_[i] += (std::min(block_variance_[i], max_block_variance) - variance_[i]) / variance_blocks;
            const bool is_valid = std::isfinite(deviation_[i]);
            silent_[i] = is_valid && noise_->repeats[i] < silent_readings && noise_->clip[i] == -infinity &&
                         variance_[i] < min_variance;
            has_noisy_ = has_noisy_ || (is_valid && variance_[i] > max_variance),
            has_silent_ = has_silent_ || silent_[i];
        }
    }

    // Return whether the skin had a load, or a taxel surely a contact, in the block.
    bool is_loaded() const noexcept {
        const Noise& noise = *noise_;
        double load = 0;
        for (std::size_t i = 0; i < skin_->n; ++i) {
            if (std::isfinite(deviation_[i])) load += change_[i] * noise.slopes[i];
            if (peak_[i] > noise.sure[i] - noise.free[i] + offset[i] * (*sign_)[i]) return true;
        }
        return load > noise.load_level;
    }

    // Move the baseline of the free taxels to their mean change, by the time since it last moved.
    void follow(double time) noexcept {
        const double elapsed = time - moved_;
        const double gain = -std::expm1(-(elapsed > block_time ? elapsed : block_time) / tracking_time);
        moved_ = time;
        for (std::size_t i = 0; i < skin_->n; ++i)
            if (free_[i]) offset[i] += gain * (change_[i] * (*sign_)[i]);
    }

    const SkinGeometry* skin_ = nullptr;
    const Noise* noise_ = nullptr;
    const Numbers* sign_ = nullptr;
    bool is_followed_ = true;
    double moved_ = not_a_number; // time at which the baseline last moved [s]
    int off_ = 0;                 // number of blocks with a drift since the last one without
    bool is_reported_ = false, is_positive_ = false;
    bool is_touched_ = false; // whether the load of the last frame was too large for a drift
    double largest_ = 0;      // load that the largest drift shows [N]
    bool has_noisy_ = false, has_silent_ = false;
    Booleans silent_;                            // (n,) whether a free taxel sends one number only
    Numbers variance_;                           // (n,) filtered, relative to that at rest
    double start_ = infinity, next_ = -infinity; // of the block, of the next frame that counts [s]
    std::size_t count_ = 0;
    bool is_mixed_ = false;
    double lowest_ = infinity, highest_ = 0; // deviation that all taxels have in common
    Numbers sum_, squares_, peak_, change_, deviation_, sorted_, block_variance_;
    Booleans free_;
};

} // namespace skin_calib
