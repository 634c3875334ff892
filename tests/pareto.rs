//! `octray pareto`: the files that it writes.

mod command;

use std::fs;

use command::Room;

#[test]
fn pareto_writes_a_page_plots_and_a_table() {
    let room = Room::new();
    fs::create_dir(room.path("b")).unwrap();
    fs::copy(room.path("scene.toml"), room.path("b/scene.toml")).unwrap();
    let (out, err) = room.texts("pareto scene.toml b/scene.toml --time-budget 0.2 --resolution 24x16 -t 1", 0);
    assert!(out.contains("scene: the front (against ") && err.contains("scene: packet, 1 spp: "), "{out}{err}");
    let text = |name: &str| fs::read_to_string(room.path("pareto").join(name)).unwrap();
    let table = text("points.csv");
    let columns =
        "scene,series,engine,certified,filter,triangles_per_sphere,spp,seconds,wall_seconds,rmse,rel_mse,max,front";
    assert_eq!(table.lines().next(), Some(columns));
    for row in table.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        assert_eq!(cells.len(), 13, "{row}");
        assert!(cells[7..12].iter().all(|cell| cell.parse::<f64>().is_ok_and(|x| x >= 0.0)), "{row}");
    }
    assert!(table.contains(",spheres as 968 triangles,packet,true,gaussian,968,1,"), "{table}");
    assert!(table.lines().any(|row| row.ends_with(",true")));
    for name in ["scene.rmse.svg", "scene.rel_mse.svg", "scene.max.svg", "scene-2.rmse.svg"] {
        assert!(text(name).starts_with("<svg"), "{name}");
    }
    let page = text("index.html");
    assert!(page.matches("<h2>scene</h2>").count() == 2 && page.contains("data:image/png;base64,iVBOR"));
    assert!(!page.contains("<script") && !page.contains("<link") && !page.contains("src=\"http"));
}

#[test]
fn pareto_says_what_it_cannot_do() {
    let room = Room::new();
    room.texts("pareto", 2);
    room.texts("pareto none.toml", 3);
    room.texts("pareto scene.toml --time-budget -1", 2);
    room.write("file", "");
    room.texts("pareto scene.toml --out-dir file", 4);
    room.write("bare.toml", "format = 1\n");
    assert!(room.texts("pareto bare.toml", 3).1.contains("camera"));
}
