/* Developable sheets: photo points on the page, and page points in the photo.

   Points are taken in blocks whose arrays stay in the first cache, components before points. NaN stays NaN: it fails
   comparisons, which are written so that it then passes. */

#include "surface.h"

#include <math.h>
#include <stdlib.h>

enum { POINTS = 64 }; /* of a block */

/* Frames (3) of rulings at s. */
struct rulings {
    double P[3][POINTS], R[3][POINTS], A[3][POINTS];
};

/* At a node: P x R, its rate in s times the step, and it again in single precision. */
struct moment {
    double value[3], rate[3];
    float near[3];
};

static inline double away_from_zero(double value) {
    const double least = 1e-9;
    return fabs(value) < least ? (value < 0 ? -least : least) : value;
}

/* P and R between two nodes by Hermite's cubics, whose slopes are A and w' A; A is linear. Beyond the table the surface
   is straight. */
AVX2 static void find_rulings(const struct sheet *sheet, const double *restrict s, int count, struct rulings *restrict found) {
    const double step = sheet->step;
    const double *tables[2] = {sheet->P, sheet->R};
    int left[POINTS];
    double x[POINTS], h1[POINTS], h2[POINTS], h3[POINTS], before[POINTS], after[POINTS], rates[2][POINTS];
    for (int i = 0; i < count; i++) left[i] = node_before(sheet, s[i]);
    for (int i = 0; i < count; i++) {
        const double here = sheet->nodes[left[i]];
        x[i] = (s[i] - here) / step;
        rates[0][i] = slope_rate(sheet, here);
        rates[1][i] = slope_rate(sheet, sheet->nodes[left[i] + 1]);
        h1[i] = x[i] * x[i] * (3 - 2 * x[i]);
        h2[i] = step * x[i] * ((1 - x[i]) * (1 - x[i]));
        h3[i] = step * x[i] * x[i] * (x[i] - 1);
        before[i] = step * x[i];
        after[i] = step * (x[i] - 1);
    }
    for (int k = 0; k < 3; k++) {
        double here[POINTS], there[POINTS];
        for (int i = 0; i < count; i++) {
            here[i] = sheet->A[3 * left[i] + k];
            there[i] = sheet->A[3 * left[i] + 3 + k];
            const double inner = x[i] < 0 ? 0 : x[i] > 1 ? 1 : x[i];
            found->A[k][i] = (1 - inner) * here[i] + inner * there[i];
        }
        for (int table = 0; table < 2; table++) {
            double *restrict out = table ? found->R[k] : found->P[k];
            for (int i = 0; i < count; i++) {
                const double y0 = tables[table][3 * left[i] + k], y1 = tables[table][3 * left[i] + 3 + k];
                const double m0 = table ? rates[0][i] * here[i] : here[i];
                const double m1 = table ? rates[1][i] * there[i] : there[i];
                const double inside = y0 + h1[i] * (y1 - y0) + h2[i] * m0 + h3[i] * m1;
                out[i] = x[i] < 0 ? y0 + before[i] * m0 : x[i] > 1 ? y1 + after[i] * m1 : inside;
            }
        }
    }
}

/* Moments (last - first + 1,) of the nodes that face the camera; their number that grow along the lines of sight, whose
   sum is `sights` (3,), less the number that shrink. */
static int find_moments(const struct sheet *sheet, const double *sights, struct moment *moments) {
    int way = 0;
    for (int node = sheet->first; node <= sheet->last; node++) {
        struct moment *moment = moments + (node - sheet->first);
        const double *P = sheet->P + 3 * node, *A = sheet->A + 3 * node, *R = sheet->R + 3 * node;
        const double rate = slope_rate(sheet, sheet->nodes[node]), bent[3] = {rate * A[0], rate * A[1], rate * A[2]};
        double turned[3], moved[3], grown = 0;
        cross(P, R, moment->value);
        cross(A, R, turned);
        cross(P, bent, moved);
        for (int k = 0; k < 3; k++) {
            moment->near[k] = (float)moment->value[k];
            grown += sights[k] * (turned[k] + moved[k]);
            moment->rate[k] = sheet->step * (turned[k] + moved[k]);
        }
        way += (grown > 0) - (grown < 0);
    }
    return way;
}

/* s of photo points (x, y): the root of d . (P x R) on the Hermite cubic between the nodes where it changes its sign. */
AVX2 static void find_roots(
    const struct sheet *sheet, const struct moment *moments, int way, const double *restrict x,
    const double *restrict y, int count, double *restrict s) {
    const int nodes = sheet->last - sheet->first + 1;
    const double focal = sheet->focal;
    /* Single precision is enough to find the interval: where the sign is unsure the root is at the node. */
    float near[2][POINTS] = {0};
    int32_t before[POINTS] = {0};
    for (int i = 0; i < count; i++) {
        near[0][i] = (float)x[i];
        near[1][i] = (float)y[i];
    }
    const float sign = way > 0 ? 1.0f : -1.0f;
    for (int node = 0; node < nodes; node++) {
        const float a = sign * moments[node].near[0], b = sign * moments[node].near[1];
        const float c = sign * moments[node].near[2] * (float)focal;
        for (int i = 0; i < POINTS; i++) before[i] += a * near[0][i] + b * near[1][i] + c < 0;
    }
    int left[POINTS];
    for (int i = 0; i < count; i++) {
        const int at = before[i] - (way != 0);
        left[i] = at < 0 ? 0 : at > nodes - 2 ? nodes - 2 : at;
    }
    /* Values and slopes of the moments at both nodes of the interval. */
    double y0[POINTS], m0[POINTS], y1[POINTS], m1[POINTS];
    for (int i = 0; i < count; i++) {
        const struct moment *here = moments + left[i], *there = here + 1;
        y0[i] = x[i] * here->value[0] + y[i] * here->value[1] + focal * here->value[2];
        m0[i] = x[i] * here->rate[0] + y[i] * here->rate[1] + focal * here->rate[2];
        y1[i] = x[i] * there->value[0] + y[i] * there->value[1] + focal * there->value[2];
        m1[i] = x[i] * there->rate[0] + y[i] * there->rate[1] + focal * there->rate[2];
    }
    for (int i = 0; i < count; i++) {
        const double c2 = 3 * (y1[i] - y0[i]) - 2 * m0[i] - m1[i], c3 = 2 * (y0[i] - y1[i]) + m0[i] + m1[i];
        double part = y0[i] / away_from_zero(y0[i] - y1[i]);
        for (int pass = 0; pass < 3; pass++) {
            const double value = y0[i] + part * (m0[i] + part * (c2 + part * c3));
            part = part - value / away_from_zero(m0[i] + part * (2 * c2 + 3 * part * c3));
        }
        /* Beyond the table the last interval is continued. */
        part = part < -50 ? -50 : part > 50 ? 50 : part;
        s[i] = sheet->nodes[sheet->first + left[i]] + sheet->step * part;
    }
}

/* The page at points (x, y) of the photo whose rulings `at` are known: all else of `points` from number `begin` on. */
AVX2 static void unroll_block(
    const struct sheet *sheet, const double *restrict x, const double *restrict y, const double *restrict s,
    const struct rulings *restrict at, int count, const struct points *points, ptrdiff_t begin) {
    const double focal = sheet->focal, c = sheet->cosine, e = sheet->sine;
    double t[POINTS], page[2][POINTS], J[4][POINTS], X[3][POINTS];
    for (int i = 0; i < count; i++) {
        /* d x (P + t R) = 0, by least squares. */
        const double R[3] = {at->R[0][i], at->R[1][i], at->R[2][i]}, P[3] = {at->P[0][i], at->P[1][i], at->P[2][i]};
        const double dR[3] = {y[i] * R[2] - focal * R[1], focal * R[0] - x[i] * R[2], x[i] * R[1] - y[i] * R[0]};
        const double dP[3] = {y[i] * P[2] - focal * P[1], focal * P[0] - x[i] * P[2], x[i] * P[1] - y[i] * P[0]};
        const double square = dR[0] * dR[0] + dR[1] * dR[1] + dR[2] * dR[2];
        t[i] = -(dR[0] * dP[0] + dR[1] * dP[1] + dR[2] * dP[2]) / (square < 1e-300 ? 1e-300 : square);
        for (int k = 0; k < 3; k++) X[k][i] = P[k] + t[i] * R[k];
    }
    for (int i = 0; i < count; i++) {
        /* d photo / d (s, t) = (f I | -x) (X_s X_t) / Z. */
        const double grow = 1 + t[i] * slope_rate(sheet, s[i]), w = slope_at(sheet, s[i]);
        const double scale = focal / X[2][i], px = x[i] / X[2][i], py = y[i] / X[2][i];
        const double along_x = grow * (scale * at->A[0][i] - px * at->A[2][i]);
        const double along_y = grow * (scale * at->A[1][i] - py * at->A[2][i]);
        const double down_x = scale * at->R[0][i] - px * at->R[2][i];
        const double down_y = scale * at->R[1][i] - py * at->R[2][i];
        const double det = away_from_zero(along_x * down_y - along_y * down_x);
        /* d (a, b) = ((1 + t w', w), (0, 1)) d (s, t), then the turn by the skew. */
        const double u_s = c * grow / det, u_t = (c * w + e) / det, v_s = -e * grow / det, v_t = (c - e * w) / det;
        J[0][i] = u_s * down_y - u_t * along_y;
        J[1][i] = u_t * along_x - u_s * down_x;
        J[2][i] = v_s * down_y - v_t * along_y;
        J[3][i] = v_t * along_x - v_s * down_x;
        const double a = s[i] + t[i] * w;
        page[0][i] = c * a + e * t[i];
        page[1][i] = c * t[i] - e * a;
    }
    for (int i = 0; i < count; i++) {
        const ptrdiff_t to = begin + i;
        points->sheet[2 * to] = s[i];
        points->sheet[2 * to + 1] = t[i];
        for (int k = 0; k < 2; k++) points->page[2 * to + k] = page[k][i];
        for (int k = 0; k < 4; k++) points->jacobians[4 * to + k] = J[k][i];
    }
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < count; i++) {
            points->X[k * points->count + begin + i] = X[k][i];
            points->A[k * points->count + begin + i] = at->A[k][i];
            points->R[k * points->count + begin + i] = at->R[k][i];
        }
}

/* The page at the photo's `points`. Returns 0 where memory is missing. */
int unroll_points(const struct sheet *sheet, const struct points *points) {
    struct moment *moments = malloc((sheet->last - sheet->first + 1) * sizeof *moments);
    if (!moments) return 0;
    double sights[3] = {0, 0, sheet->focal * points->count};
    for (ptrdiff_t i = 0; i < points->count; i++)
        for (int k = 0; k < 2; k++) sights[k] += points->photo[2 * i + k];
    const int way = find_moments(sheet, sights, moments);
    for (ptrdiff_t begin = 0; begin < points->count; begin += POINTS) {
        const int count = points->count - begin < POINTS ? (int)(points->count - begin) : POINTS;
        double x[POINTS], y[POINTS], s[POINTS];
        struct rulings at;
        for (int i = 0; i < count; i++) {
            x[i] = points->photo[2 * (begin + i)];
            y[i] = points->photo[2 * (begin + i) + 1];
        }
        find_roots(sheet, moments, way, x, y, count, s);
        find_rulings(sheet, s, count, &at);
        unroll_block(sheet, x, y, s, &at, count, points, begin);
    }
    free(moments);
    return 1;
}

/* Where `page` points (count, 2) are seen, (count, 2): NaN beyond the camera, where rulings are nearer to each other
   than `least_growth`, and where the sheet turns away. */
AVX2 void see_points(
    const struct sheet *sheet, const double *page, ptrdiff_t points, double least_growth, double *seen) {
    for (ptrdiff_t begin = 0; begin < points; begin += POINTS) {
        const int count = points - begin < POINTS ? (int)(points - begin) : POINTS;
        double s[POINTS], t[POINTS];
        struct rulings at;
        for (int i = 0; i < count; i++) {
            /* The root of s + b w(s) = a whose growth ds/da is positive. */
            const double u = page[2 * (begin + i)], v = page[2 * (begin + i) + 1];
            const double a = sheet->cosine * u - sheet->sine * v, b = sheet->sine * u + sheet->cosine * v;
            const double at_origin = 1 + b * sheet->slopes[0];
            const double square = at_origin * at_origin + 4 * a * b * sheet->slopes[1];
            s[i] = 2 * a / away_from_zero(at_origin + sqrt(square < 0 ? 0 : square));
            t[i] = b;
        }
        find_rulings(sheet, s, count, &at);
        for (int i = 0; i < count; i++) {
            const double R[3] = {at.R[0][i], at.R[1][i], at.R[2][i]}, A[3] = {at.A[0][i], at.A[1][i], at.A[2][i]};
            double X[3], N[3];
            for (int k = 0; k < 3; k++) X[k] = at.P[k][i] + t[i] * R[k];
            cross(A, R, N);
            const double growth = 1 + t[i] * slope_rate(sheet, s[i]), facing = N[0] * X[0] + N[1] * X[1] + N[2] * X[2];
            const int hidden = (X[2] <= 1e-6) | (growth < least_growth) | (facing <= 0);
            for (int k = 0; k < 2; k++) seen[2 * (begin + i) + k] = hidden ? NAN : sheet->focal * X[k] / X[2];
        }
    }
}

/* Frames (count, 3, 3), columns A, B, N, of a sheet that turns by `turns` (count - 1, 3) from node to node. */
void roll_frames(const double *turns, ptrdiff_t count, double *frames) {
    for (int k = 0; k < 9; k++) frames[k] = k % 4 == 0;
    for (ptrdiff_t n = 0; n + 1 < count; n++) {
        /* Rodrigues: I + sin(a) / a K + (1 - cos(a)) / a^2 K K. */
        const double x = turns[3 * n], y = turns[3 * n + 1], z = turns[3 * n + 2];
        const double size = sqrt(x * x + y * y + z * z), angle = size < 1e-12 ? 1e-12 : size;
        const double sine = sin(angle) / angle, rest = (1 - cos(angle)) / (angle * angle);
        const double K[3][3] = {{0, -z, y}, {z, 0, -x}, {-y, x, 0}};
        for (int i = 0; i < 3; i++) {
            double *next = frames + 9 * (n + 1) + 3 * i;
            const double *row = frames + 9 * n + 3 * i;
            for (int j = 0; j < 3; j++) {
                double turned = 0;
                for (int k = 0; k < 3; k++) {
                    const double square = K[k][0] * K[0][j] + K[k][1] * K[1][j] + K[k][2] * K[2][j];
                    turned += row[k] * ((k == j) + sine * K[k][j] + rest * square);
                }
                next[j] = turned;
            }
        }
    }
}
